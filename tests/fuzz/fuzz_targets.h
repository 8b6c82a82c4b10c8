#pragma once
// All readers of files, for libFuzzer (fuzz.cpp) and for the replay of corpora (replay.cpp).

#include <cstddef>
#include <functional>
#include <map>
#include <span>
#include <string>

namespace lobe::fuzz {

using Bytes = std::span<const std::byte>;
/// Reads the bytes as the content of a file. Throws std::runtime_error if the reader refuses them.
using FuzzTarget = std::function<void(Bytes)>;
using FuzzTargets = std::map<std::string, FuzzTarget>;

/// The readers by the name of the format. "lobe-payload" and the like read the input as the payload of a container
/// whose hash is right.
const FuzzTargets& fuzzTargets();

/// Calls the reader. Any exception but std::runtime_error passes, and is a finding.
void readOrRefuse(const FuzzTarget& read, Bytes bytes);

}  // namespace lobe::fuzz
