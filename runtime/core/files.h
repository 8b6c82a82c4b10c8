#pragma once
// Reading whole files, and hashing their content.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <new>
#include <span>
#include <stdexcept>
#include <string>

#include <fmt/format.h>

namespace lobe {

/// Opens a regular file for binary reading. Throws std::runtime_error with the reason, but without the name of the
/// file, which nameErrors adds.
std::ifstream openFile(const std::filesystem::path& path);

/// The content of a regular file. Throws like openFile.
std::string readFile(const std::filesystem::path& path);

/// Too little memory for reading a file. It is no std::runtime_error, so that code which tolerates faulty files does
/// not tolerate this: the file may be sound.
class OutOfMemory : public std::bad_alloc {
 public:
  // NOLINTNEXTLINE(bugprone-throw-keyword-missing): it initialises a member.
  explicit OutOfMemory(const std::filesystem::path& path) : message_(path.string() + ": not enough memory") {}
  const char* what() const noexcept override { return message_.what(); }

 private:
  std::runtime_error message_;  // unlike a std::string, it can be copied without memory
};

/// Returns the result of read(). Exceptions are converted to std::runtime_error with the name of the file prepended,
/// but std::bad_alloc to OutOfMemory.
template <class Read>
auto nameErrors(const std::filesystem::path& path, Read&& read) {
  try {
    return read();
  } catch (const std::bad_alloc&) {
    throw OutOfMemory(path);
  } catch (const std::exception& e) {
    throw std::runtime_error(fmt::format("{}: {}", path.string(), e.what()));
  }
}

/// The end of the name from the last dot on, in lower case; empty without a dot.
std::string extensionOf(const std::filesystem::path& path);

/// XXH3-64 of the bytes.
std::uint64_t contentHash(std::string_view bytes);

}  // namespace lobe
