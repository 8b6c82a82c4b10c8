#include "runtime/render/camera.h"

#include <array>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/LU>

namespace lobe {
namespace {

constexpr int kGaussianIntervals = 256;

// Mitsuba's: the Gaussian minus its value at the radius.
DiscreteDistribution gaussianIntervals(const PixelFilter& filter) {
  std::array<float, kGaussianIntervals> weights;
  const float scale = -0.5f / (filter.stddev * filter.stddev);
  const float end = std::exp(scale * filter.radius * filter.radius);
  for (int i = 0; i < kGaussianIntervals; ++i) {
    const float x = filter.radius * (2.0f * (i + 0.5f) / kGaussianIntervals - 1.0f);
    weights[i] = std::max(0.0f, std::exp(scale * x * x) - end);
  }
  return DiscreteDistribution(weights);
}

void check(const Camera& camera) {
  if (camera.width < 1 || camera.height < 1)
    throw std::runtime_error(
        fmt::format("camera: an image of {}x{} pixels cannot be rendered", camera.width, camera.height));
  if (!(camera.horizontalFov > 0.0f && camera.horizontalFov < 180.0f))
    throw std::runtime_error(
        fmt::format("camera: the field of view is {} degrees, not between 0 and 180", camera.horizontalFov));
  const float determinant = camera.toWorld.topLeftCorner<3, 3>().determinant();
  if (!camera.toWorld.allFinite() || determinant == 0.0f)
    throw std::runtime_error("camera: the to_world matrix cannot be inverted");
}

}  // namespace

FilterSampler::FilterSampler(const PixelFilter& filter) : filter_(filter) {
  if (!(filter.radius > 0.0f)) throw std::runtime_error("reconstruction filter: the radius is not positive");
  if (filter.kind != PixelFilter::Kind::gaussian) return;
  if (!(filter.stddev > 0.0f))
    throw std::runtime_error("reconstruction filter: the standard deviation is not positive");
  gaussian_ = gaussianIntervals(filter);
}

float FilterSampler::sample(float u) const {
  switch (filter_.kind) {
    case PixelFilter::Kind::box:
      return filter_.radius * (2.0f * u - 1.0f);
    case PixelFilter::Kind::tent:
      return filter_.radius * (u < 0.5f ? std::sqrt(2.0f * u) - 1.0f : 1.0f - std::sqrt(2.0f - 2.0f * u));
    case PixelFilter::Kind::gaussian:
      break;
  }
  const std::size_t interval = gaussian_.sample(u);
  return filter_.radius * (2.0f * (static_cast<float>(interval) + u) / kGaussianIntervals - 1.0f);
}

PinholeCamera::PinholeCamera(const Camera& camera, const PixelFilter& filter)
    : width_(camera.width), height_(camera.height), filter_(filter) {
  check(camera);
  const Eigen::Matrix3f toWorld = camera.toWorld.topLeftCorner<3, 3>();
  position_ = camera.toWorld.topRightCorner<3, 1>();
  const float tangent = std::tan(0.5f * camera.horizontalFov * kPi / 180.0f);
  const float pixel = 2.0f * tangent / width_;
  // +x is left: columns run towards −x, rows towards −y.
  corner_ = toWorld * Vec3(tangent, tangent * height_ / width_, 1.0f);
  right_ = toWorld * Vec3(-pixel, 0.0f, 0.0f);
  down_ = toWorld * Vec3(0.0f, -pixel, 0.0f);
}

Ray PinholeCamera::rayThrough(const Vec2& point) const {
  return {position_, (corner_ + point.x() * right_ + point.y() * down_).normalized()};
}

}  // namespace lobe
