#pragma once
// A texture looked up in an image.

#include <memory>

#include "materials/image.h"
#include "materials/texture.h"

namespace lobe {

/// What lies outside the unit square: the image again, its mirror image, or its border pixels for ever.
enum class Wrap { repeat, mirror, clamp };

struct BitmapOptions {
  Wrap wrapU = Wrap::repeat, wrapV = Wrap::repeat;
  bool nearest = false;  ///< one pixel instead of bilinear interpolation
  Vec2 uvScale{1, 1};    ///< applied first
  Vec2 uvOffset{0, 0};   ///< added to the scaled coordinate
};

/// The image over the unit square, its first row at v = 0 as in Mitsuba: pixel (x, y) has its centre at
/// ((x + ½)/width, (y + ½)/height). Coordinates that are not finite or too large for floats to tell pixels apart give
/// the mean. Several textures may share one image. Throws std::runtime_error when the image is empty.
TexturePtr makeBitmap(std::shared_ptr<const Image> image, const BitmapOptions& options = {});

}  // namespace lobe
