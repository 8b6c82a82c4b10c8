#pragma once
// Opening EXR files that may be damaged.

#include <filesystem>
#include <memory>
#include <new>
#include <stdexcept>
#include <string_view>

#include <Iex.h>
#include <ImfInputFile.h>
#include <fmt/format.h>

#include "runtime/core/files.h"

namespace lobe {

/// Returns the result of read(). Exceptions of OpenEXR are converted to std::runtime_error that names the file, and
/// missing memory to OutOfMemory.
template <class Read>
auto nameExrErrors(const std::filesystem::path& path, Read&& read) {
  try {
    return read();
  } catch (const std::bad_alloc&) {
    throw OutOfMemory(path);
  } catch (const Iex::BaseExc& e) {
    // OpenEXR keeps only the text of exceptions in its tasks.
    if (std::string_view(e.what()).ends_with("std::bad_alloc")) throw OutOfMemory(path);
    throw std::runtime_error(fmt::format("{}: damaged EXR file ({})", path.string(), e.what()));
  }
}

/// Opens the file after checking what its header claims, because OpenEXR allocates memory for the attributes and lines
/// of pixels before it reads them. Throws std::runtime_error if the header is damaged, or if the image (image_limits.h)
/// or the blocks in which it is compressed are too large.
std::unique_ptr<Imf::InputFile> openExr(const std::filesystem::path& path);

}  // namespace lobe
