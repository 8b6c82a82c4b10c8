#pragma once
// Pictures in Radiance's format (.hdr): RGBE and XYZE.

#include <array>
#include <string_view>

#include "runtime/image/image.h"

namespace lobe {

/// Whether the bytes are the beginning of such a picture.
bool startsLikeRgbe(std::string_view bytes);

/// Width and height of the picture. Throws like readRgbe.
std::array<int, 2> sizeOfRgbe(std::string_view bytes);

/// The picture as it is to be seen, in whatever order its rows and columns are stored; flat pixels and both kinds of
/// run lengths. XYZE becomes linear Rec. 709. An exposure in the header is not undone, as in Mitsuba. Throws
/// std::runtime_error with the fault, without the name of a file.
Image readRgbe(std::string_view bytes);

}  // namespace lobe
