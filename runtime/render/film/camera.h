#pragma once
// Camera rays. Each sample contributes to one pixel: the reconstruction filter is importance sampled (Ernst et al.
// 2006, "Filter Importance Sampling"), so that pixels are means of independent samples and need no splatting. Negative
// lobes of filters are omitted, so that pixels are never negative: mitchell, catmullrom and lanczos give slightly
// softer images than with splatting.

#include "runtime/core/distribution.h"
#include "runtime/core/sampler.h"
#include "runtime/render/geometry/ray.h"
#include "scenes/scene.h"

namespace lobe {

/// Samples offsets from a pixel's centre, in pixels, with a density proportional to the positive part of the filter.
class FilterSampler {
 public:
  /// Throws std::runtime_error if the filter is invalid.
  explicit FilterSampler(const PixelFilter& filter);
  /// u uniform in [0,1)².
  Vec2 sample(const Vec2& u) const { return {sample(u.x()), sample(u.y())}; }

 private:
  float sample(float u) const;
  PixelFilter filter_;
  DiscreteDistribution intervals_;  // over equal intervals of [−radius, radius], for filters without closed form
};

/// Generates the rays of a perspective (pinhole or thin lens) or orthographic camera.
class RayCamera {
 public:
  /// Throws std::runtime_error if the size, field of view, lens or matrix is invalid.
  RayCamera(const Camera& camera, const PixelFilter& filter);

  /// Size of the image in pixels: the whole film or its crop.
  int width() const { return width_; }
  int height() const { return height_; }

  /// The ray through an image point in pixels; (0, 0) is the top left corner of the image. lens: where the ray leaves
  /// the lens, a point in the unit disc. The ray starts and ends at the clip planes of the camera.
  Ray rayThrough(const Vec2& point, const Vec2& lens = Vec2::Zero()) const;

  /// A random ray for the pixel in column x and row y, from a random point on the lens.
  Ray sample(int x, int y, Sampler& rng) const;

 private:
  Ray clipped(const Vec3& origin, const Vec3& direction) const;

  Camera::Kind kind_;
  int width_, height_;
  Vec3 position_;
  Vec3 axis_;          // unit, the viewing direction
  Vec3 corner_;        // from the position to the top left corner of the image on the film plane (not unit)
  Vec3 right_, down_;  // steps by one pixel on the film plane
  Vec3 lensX_, lensY_;
  float focus_;       // focus distance: points at corner_ times this are in focus
  float near_, far_;  // clip planes, as distances along axis_ in world units
  FilterSampler filter_;
};

}  // namespace lobe
