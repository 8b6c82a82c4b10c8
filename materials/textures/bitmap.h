#pragma once
// A texture looked up in an image.

#include <memory>

#include "materials/texture.h"
#include "materials/textures/uv_map.h"
#include "runtime/image/image.h"

namespace lobe {

/// What lies outside the unit square: the image again, its mirror image, its border pixels for ever, black or white.
enum class Wrap { repeat, mirror, clamp, zero, one };

struct BitmapOptions {
  Wrap wrapU = Wrap::repeat, wrapV = Wrap::repeat;
  bool nearest = false;  ///< one pixel instead of bilinear interpolation
  UvMap uvMap = {};      ///< from the surface's coordinates to the image's
};

/// The image over the unit square, its first row at v = 0 as in Mitsuba: pixel (x, y) has its centre at
/// ((x + ½)/width, (y + ½)/height). Coordinates that are not finite or too large for floats to tell pixels apart give
/// the mean, which is that of the image itself. Several textures may share one image. Throws std::runtime_error when
/// the image is empty.
TexturePtr makeBitmap(std::shared_ptr<const Image> image, const BitmapOptions& options = {});

}  // namespace lobe
