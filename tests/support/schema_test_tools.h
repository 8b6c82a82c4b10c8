#pragma once
// What the tests of cache files share: a folder, and files that are wrong in one thing only.

#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include <xxhash.h>
#include <catch2/catch.hpp>

namespace lobe::test {

/// A folder of the test's own, removed at its end.
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

/// Makes header and hash right for whatever is in the bytes.
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
