#pragma once
// Radiance images (.hdr) in RGBE and XYZE.

#include <array>
#include <string_view>

#include "runtime/image/image.h"

namespace lobe {

/// Whether the bytes begin with the signature of a Radiance image.
bool startsLikeRgbe(std::string_view bytes);

/// Width and height of the image. Throws like readRgbe.
std::array<int, 2> sizeOfRgbe(std::string_view bytes);

/// Decodes an image stored in any order of rows and columns, uncompressed or with either run-length encoding. XYZE is
/// converted to linear Rec. 709. The exposure in the header is ignored, as in Mitsuba. Throws std::runtime_error; its
/// message does not name the file.
Image readRgbe(std::string_view bytes);

}  // namespace lobe
