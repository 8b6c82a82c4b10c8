#pragma once
// Camera rays. A sample belongs to one pixel: the reconstruction filter is sampled by importance, so that pixels are
// means of independent samples and need no splatting. A filter's negative parts are left out, for pictures are never
// negative: mitchell, catmullrom and lanczos give a picture a little softer than splatting with them would.

#include "runtime/core/distribution.h"
#include "runtime/core/random.h"
#include "runtime/render/geometry/ray.h"
#include "scenes/scene.h"

namespace lobe {

/// Draws offsets from a pixel's centre, in pixels, with a density proportional to the filter where it is positive.
class FilterSampler {
 public:
  /// Throws std::runtime_error for a filter without meaning.
  explicit FilterSampler(const PixelFilter& filter);
  /// u uniform in [0,1)².
  Vec2 sample(const Vec2& u) const { return {sample(u.x()), sample(u.y())}; }

 private:
  float sample(float u) const;
  PixelFilter filter_;
  DiscreteDistribution intervals_;  // equal ones of [−radius, radius], for filters without a closed form
};

/// The rays of a perspective (with a pinhole or a thin lens) or orthographic camera.
class RayCamera {
 public:
  /// Throws std::runtime_error for a size, field of view, lens or matrix without meaning.
  RayCamera(const Camera& camera, const PixelFilter& filter);

  /// Of the picture, in pixels: the whole film or its crop.
  int width() const { return width_; }
  int height() const { return height_; }

  /// The ray through an image point in pixels: (0, 0) is the top left corner of the picture. lens: where it leaves the
  /// lens, a point of the unit disc. It begins and ends at the camera's clip planes.
  Ray rayThrough(const Vec2& point, const Vec2& lens = Vec2::Zero()) const;

  /// A ray for the pixel in column x and row y, from anywhere on the lens.
  Ray sample(int x, int y, Rng& rng) const;

 private:
  Ray clipped(const Vec3& origin, const Vec3& direction) const;

  Camera::Kind kind_;
  int width_, height_;
  Vec3 position_;
  Vec3 axis_;          // unit, the viewing direction
  Vec3 corner_;        // towards the top left corner (not unit), orthographic: to it
  Vec3 right_, down_;  // and what a pixel adds to it
  Vec3 lensX_, lensY_;
  float focus_;       // corner_ times this is in focus
  float near_, far_;  // clip planes: distances along axis_ in world units
  FilterSampler filter_;
};

}  // namespace lobe
