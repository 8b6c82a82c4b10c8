#pragma once
// A texture that looks up its values in an image.

#include <memory>

#include "materials/texture.h"
#include "materials/textures/uv_map.h"
#include "runtime/image/image.h"

namespace lobe {

/// Values outside the unit square: the image is repeated, mirrored or extended by its border pixels, or the value is
/// black (zero) or white (one).
enum class Wrap { repeat, mirror, clamp, zero, one };

struct BitmapOptions {
  Wrap wrapU = Wrap::repeat, wrapV = Wrap::repeat;
  bool nearest = false;  ///< nearest pixel instead of bilinear interpolation
  UvMap uvMap = {};      ///< maps surface coordinates to image coordinates
};

/// Maps the image to the unit square, with its first row at v = 0 as in Mitsuba: pixel (x, y) has its centre at ((x +
/// ½)/width, (y + ½)/height). Coordinates that are not finite, or too large for float precision to resolve pixels,
/// return the mean of the image. Several textures may share one image. Throws std::runtime_error if the image is empty.
TexturePtr makeBitmap(std::shared_ptr<const Image> image, const BitmapOptions& options = {});

}  // namespace lobe
