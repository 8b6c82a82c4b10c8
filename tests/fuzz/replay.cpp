// Reads all files of the corpora of tests/fuzz/make_corpus.py, and some mutations of each, which are the same in every
// run: a quick check without libFuzzer.
//
// lobe_fuzz_replay CORPUS

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <span>
#include <string>
#include <vector>

#include "runtime/core/random.h"
#include "tests/fuzz/fuzz_targets.h"

namespace {

namespace fs = std::filesystem;

std::string contentOf(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Overwrites a few bytes and, in every other call, cuts off the end.
std::string mutated(std::string bytes, lobe::Rng& rng, int call) {
  const auto below = [&](std::size_t n) {
    return std::min(static_cast<std::size_t>(rng.uniform() * static_cast<float>(n)), n - 1);
  };
  for (std::size_t i = 1 + below(4); i > 0; --i) bytes[below(bytes.size())] = static_cast<char>(below(256));
  if (call % 2 == 1) bytes.resize(1 + below(bytes.size()));
  return bytes;
}

/// The number of inputs read.
int replay(const lobe::fuzz::FuzzTarget& read, const fs::path& folder) {
  constexpr int kMutations = 16;
  int inputs = 0;
  const auto readBytes = [&](const std::string& bytes) {
    lobe::fuzz::readOrRefuse(read, std::as_bytes(std::span(bytes)));
    ++inputs;
  };
  std::vector<fs::path> files(fs::directory_iterator(folder), {});
  std::ranges::sort(files);
  for (const fs::path& file : files) {
    const std::string bytes = contentOf(file);
    readBytes(bytes);
    lobe::Rng rng(1, 0, 0);
    for (int i = 0; i < kMutations && !bytes.empty(); ++i) readBytes(mutated(bytes, rng, i));
  }
  return inputs;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  for (const auto& [name, read] : lobe::fuzz::fuzzTargets()) {
    std::printf("%s", name.c_str());
    std::fflush(stdout);  // tells which reader crashed
    std::printf(": %d inputs\n", replay(read, fs::path(argv[1]) / name));
  }
  return 0;
}
