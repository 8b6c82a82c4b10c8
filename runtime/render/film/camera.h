#pragma once
// Camera rays, and the projection of points to the image. A ray passes the film at a point that is sampled from the
// reconstruction filter of one pixel (Ernst et al. 2006, "Filter Importance Sampling"), or at a given point. Negative
// lobes of filters are omitted, so that pixels are never negative: mitchell, catmullrom and lanczos give slightly
// softer images than with them.

#include <optional>

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
  /// The density of sample, in pixels⁻².
  float density(const Vec2& offset) const { return density(offset.x()) * density(offset.y()); }
  /// The density of one coordinate of sample, in pixels⁻¹; both have the same.
  float density(float offset) const;
  /// The largest distance from the pixel's centre along each axis.
  float radius() const { return filter_.radius; }

 private:
  float sample(float u) const;
  PixelFilter filter_;
  DiscreteDistribution intervals_;  // over equal intervals of [−radius, radius], for filters without closed form
};

/// A point of the scene as the camera sees it through a point of the lens.
struct CameraView {
  Vec2 film;      ///< image point in pixels
  Ray ray;        ///< from the near clip plane to the point, at the distance tfar; unit direction
  float density;  ///< RayCamera::density of the ray at the point
};

/// Where a camera ray passes: an offset from the centre of a pixel, in pixels, and a point of the lens in the unit
/// disc.
struct CameraSample {
  Vec2 offset;
  Vec2 lens;
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
  Ray sample(int x, int y, Sampler& rng) const { return rayThrough(x, y, sample(rng)); }
  /// The random numbers of `sample`, and the ray for a pixel with such numbers.
  CameraSample sample(Sampler& rng) const;
  /// The same with a given offset, in place of which the stratified numbers are left out.
  CameraSample sample(const Vec2& offset, Sampler& rng) const;
  Ray rayThrough(int x, int y, const CameraSample& sample) const {
    return rayThrough(Vec2(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f) + sample.offset, sample.lens);
  }

  /// The density over area, perpendicular to the ray, of the rays through one point of the lens at a distance from the
  /// ray's origin, if there is one ray per pixel area of the image (the importance of the camera, Veach 1997, Section
  /// 8.3). ray: as returned by the functions above.
  float density(const Ray& ray, float distance) const;

  /// The distance of a point from the lens along the viewing direction; negative behind the camera.
  float depthOf(const Vec3& point) const { return (point - position_).dot(axis_); }

  /// How a point is seen through the point `lens` of the unit disc; nullopt if it is behind the camera, outside the
  /// clip planes, or too far outside the image to contribute to a pixel.
  std::optional<CameraView> view(const Vec3& point, const Vec2& lens) const;

  bool hasLens() const { return kind_ == Camera::Kind::thinlens; }
  const FilterSampler& filter() const { return filter_; }

 private:
  Vec2 sampleLens(Sampler& rng) const;
  Ray clipped(const Vec3& origin, const Vec3& direction) const;
  bool orthographic() const { return kind_ == Camera::Kind::orthographic; }

  Camera::Kind kind_;
  int width_, height_;
  Vec3 position_;
  Vec3 axis_;          // unit, the viewing direction
  Vec3 corner_;        // from the position to the top left corner of the image on the film plane (not unit)
  Vec3 right_, down_;  // steps by one pixel on the film plane
  Vec3 lensX_, lensY_;
  // Inverse of the matrix of right_, down_ and either corner_ or, for an orthographic camera, axis_.
  Eigen::Matrix3f toFilm_;
  Vec3 pixel_;        // right_ × down_, the area of a pixel on the film plane
  float focus_;       // focus distance: points at corner_ times this are in focus
  float near_, far_;  // clip planes, as distances along axis_ in world units
  FilterSampler filter_;
};

}  // namespace lobe
