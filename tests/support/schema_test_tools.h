#pragma once
// Helpers for the tests of cache files: a temporary folder, and files with a single defect.

#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include <xxhash.h>
#include <catch2/catch.hpp>

namespace lobe::test {

/// A temporary folder that is removed in the destructor.
struct TemporaryFolder {
  std::filesystem::path path;
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "lobe-schema-XXXXXX").string();
    REQUIRE(mkdtemp(name.data()) != nullptr);
    path = name;
  }
  ~TemporaryFolder() { std::filesystem::remove_all(path); }
  std::size_t fileCount() const {
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator(path), std::filesystem::directory_iterator()));
  }
};

/// Updates the size and the hash in the header after a change of the bytes.
inline void reseal(std::vector<std::byte>& bytes) {
  const std::uint64_t size = bytes.size() - 32;
  std::memcpy(bytes.data() + 16, &size, 8);
  const std::uint64_t hash = XXH3_64bits_withSeed(bytes.data() + 32, size, XXH3_64bits(bytes.data(), 24));
  std::memcpy(bytes.data() + 24, &hash, 8);
}

inline void setVersion(std::vector<std::byte>& bytes, std::uint16_t major, std::uint16_t minor) {
  std::memcpy(bytes.data() + 8, &major, 2);
  std::memcpy(bytes.data() + 10, &minor, 2);
  reseal(bytes);
}

inline bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace lobe::test
