#pragma once
// Camera rays. A sample belongs to one pixel: the reconstruction filter is sampled by importance, so that pixels are
// means of independent samples and need no splatting.

#include "runtime/mixture/random.h"
#include "runtime/render/distribution.h"
#include "runtime/render/ray.h"
#include "scenes/scene.h"

namespace lobe {

/// Draws offsets from a pixel's centre, in pixels, with a density proportional to the filter.
class FilterSampler {
 public:
  explicit FilterSampler(const PixelFilter& filter);
  /// u uniform in [0,1)².
  Vec2 sample(const Vec2& u) const { return {sample(u.x()), sample(u.y())}; }

 private:
  float sample(float u) const;
  PixelFilter filter_;
  DiscreteDistribution gaussian_;  // over equal intervals of [−radius, radius]
};

class PinholeCamera {
 public:
  /// Throws std::runtime_error for a size, field of view or matrix without meaning.
  PinholeCamera(const Camera& camera, const PixelFilter& filter);

  int width() const { return width_; }
  int height() const { return height_; }

  /// The ray through an image point in pixels: (0, 0) is the top left corner of the image.
  Ray rayThrough(const Vec2& point) const;

  /// A ray for the pixel in column x and row y.
  Ray sample(int x, int y, Rng& rng) const {
    return rayThrough(Vec2(x + 0.5f, y + 0.5f) + filter_.sample(rng.uniform2()));
  }

  const Vec3& position() const { return position_; }

 private:
  int width_, height_;
  Vec3 position_;
  Vec3 corner_;        // direction (not unit) through the top left corner
  Vec3 right_, down_;  // and what a pixel adds to it
  FilterSampler filter_;
};

}  // namespace lobe
