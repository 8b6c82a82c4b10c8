#pragma once
// Internal to scenes/: what the readers of mesh files share.

#include <filesystem>
#include <fstream>
#include <new>
#include <stdexcept>
#include <string>

#include <fmt/format.h>

#include "scenes/scene.h"

namespace lobe {

/// The file, open for reading bytes. Throws std::runtime_error that does not name it but says why it cannot be had.
std::ifstream openFile(const std::filesystem::path& path);

/// All of a file. Throws std::runtime_error that does not name it.
std::string readBytes(const std::filesystem::path& path);

/// What read() returns. What it throws comes out as std::runtime_error that begins with the file's name.
template <class Read>
auto naming(const std::filesystem::path& path, Read&& read) {
  try {
    return read();
  } catch (const std::bad_alloc&) {
    throw std::runtime_error(fmt::format("{}: too large for the memory there is", path.string()));
  } catch (const std::exception& e) {
    throw std::runtime_error(fmt::format("{}: {}", path.string(), e.what()));
  }
}

}  // namespace lobe
