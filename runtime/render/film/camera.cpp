#include "runtime/render/film/camera.h"

#include <array>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/LU>

namespace lobe {
namespace {

constexpr int kIntervals = 512;

double mitchell(double x, double b, double c) {
  x = std::abs(x);
  if (x < 1) return ((12 - 9 * b - 6 * c) * x * x * x + (-18 + 12 * b + 6 * c) * x * x + (6 - 2 * b)) / 6;
  if (x >= 2) return 0;
  return ((-b - 6 * c) * x * x * x + (6 * b + 30 * c) * x * x + (-12 * b - 48 * c) * x + (8 * b + 24 * c)) / 6;
}

double sinc(double x) {
  return std::abs(x) > 1e-6 ? std::sin(kPi * x) / (kPi * x) : 1;
}

/// Filters as defined in Mitsuba.
double valueOf(const PixelFilter& filter, double x) {
  if (filter.kind == PixelFilter::Kind::mitchell) return mitchell(2 * x / filter.radius, filter.b, filter.c);
  if (filter.kind == PixelFilter::Kind::lanczos) return sinc(x) * sinc(x / filter.radius);
  const double scale = -0.5 / (static_cast<double>(filter.stddev) * filter.stddev);
  return std::exp(scale * x * x) - std::exp(scale * filter.radius * filter.radius);
}

DiscreteDistribution positivePart(const PixelFilter& filter) {
  std::array<float, kIntervals> weights;
  for (int i = 0; i < kIntervals; ++i) {
    const double x = filter.radius * (2 * (i + 0.5) / kIntervals - 1);
    weights[i] = std::max(0.0f, static_cast<float>(valueOf(filter, x)));
  }
  return DiscreteDistribution(weights);
}

void check(const Camera& camera) {
  if (camera.width < 1 || camera.height < 1)
    throw std::runtime_error(
        fmt::format("camera: an image of {}x{} pixels cannot be rendered", camera.width, camera.height));
  const FilmCrop crop = camera.picture();
  if (crop.x < 0 || crop.y < 0 || crop.width < 1 || crop.height < 1 || crop.x + crop.width > camera.width ||
      crop.y + crop.height > camera.height)
    throw std::runtime_error(fmt::format("camera: a crop of {}x{} pixels at {},{} exceeds the film of {}x{} pixels",
                                         crop.width, crop.height, crop.x, crop.y, camera.width, camera.height));
  if (!(camera.apertureRadius >= 0.0f && camera.focusDistance > 0.0f))
    throw std::runtime_error(fmt::format("camera: a lens of radius {} cannot focus at distance {}",
                                         camera.apertureRadius, camera.focusDistance));
  if (!(camera.horizontalFov > 0.0f && camera.horizontalFov < 180.0f))
    throw std::runtime_error(
        fmt::format("camera: the field of view of {} degrees is not between 0 and 180", camera.horizontalFov));
  const double determinant = camera.toWorld.topLeftCorner<3, 3>().cast<double>().determinant();
  if (!camera.toWorld.allFinite() || determinant == 0.0)
    throw std::runtime_error("camera: the to_world matrix cannot be inverted");
}

}  // namespace

FilterSampler::FilterSampler(const PixelFilter& filter) : filter_(filter) {
  if (!(filter.radius > 0.0f)) throw std::runtime_error("reconstruction filter: the radius is not positive");
  if (filter.kind == PixelFilter::Kind::box || filter.kind == PixelFilter::Kind::tent) return;
  if (filter.kind == PixelFilter::Kind::gaussian && !(filter.stddev > 0.0f))
    throw std::runtime_error("reconstruction filter: the standard deviation is not positive");
  intervals_ = positivePart(filter);
  if (!(intervals_.total() > 0)) throw std::runtime_error("reconstruction filter: it has no positive values");
}

float FilterSampler::sample(float u) const {
  switch (filter_.kind) {
    case PixelFilter::Kind::box:
      return filter_.radius * (2.0f * u - 1.0f);
    case PixelFilter::Kind::tent:
      return filter_.radius * (u < 0.5f ? std::sqrt(2.0f * u) - 1.0f : 1.0f - std::sqrt(2.0f - 2.0f * u));
    default:
      break;
  }
  const std::size_t interval = intervals_.sample(u);
  return filter_.radius * (2.0f * (static_cast<float>(interval) + u) / kIntervals - 1.0f);
}

float FilterSampler::density(float offset) const {
  const float r = filter_.radius;
  if (!(offset >= -r && offset < r)) return 0.0f;
  switch (filter_.kind) {
    case PixelFilter::Kind::box:
      return 0.5f / r;
    case PixelFilter::Kind::tent:
      return (1.0f - std::abs(offset) / r) / r;
    default:
      break;
  }
  const int interval = std::min(static_cast<int>((offset / r + 1.0f) * (0.5f * kIntervals)), kIntervals - 1);
  return intervals_.probability(interval) * (0.5f * kIntervals / r);
}

RayCamera::RayCamera(const Camera& camera, const PixelFilter& filter)
    : kind_(camera.kind), position_(camera.toWorld.topRightCorner<3, 1>()), filter_(filter) {
  check(camera);
  const FilmCrop picture = camera.picture();
  width_ = picture.width, height_ = picture.height;
  const Eigen::Matrix3f toWorld = camera.toWorld.topLeftCorner<3, 3>();
  axis_ = toWorld.col(2).normalized();
  // The film plane is at distance 1; an orthographic film extends from −1 to 1.
  const float half = orthographic() ? 1.0f : std::tan(0.5f * camera.horizontalFov * kPi / 180.0f);
  const float pixel = 2.0f * half / camera.width;
  // +x is left: columns run towards −x, rows towards −y.
  right_ = toWorld * Vec3(-pixel, 0.0f, 0.0f);
  down_ = toWorld * Vec3(0.0f, -pixel, 0.0f);
  corner_ = toWorld * Vec3(half, half * camera.height / camera.width, orthographic() ? 0.0f : 1.0f);
  corner_ += (picture.x + camera.shift.x() * camera.width) * right_;
  corner_ += (picture.y + camera.shift.y() * camera.height) * down_;
  Eigen::Matrix3d film;
  film << right_.cast<double>(), down_.cast<double>(), (orthographic() ? axis_ : corner_).cast<double>();
  toFilm_ = film.inverse().cast<float>();
  pixel_ = right_.cross(down_);
  const float radius = kind_ == Camera::Kind::thinlens ? camera.apertureRadius : 0.0f;
  lensX_ = toWorld.col(0) * radius;
  lensY_ = toWorld.col(1) * radius;
  focus_ = camera.focusDistance;
  const float unit = toWorld.col(2).norm();
  near_ = camera.nearClip * unit;
  far_ = camera.farClip * unit;
}

Ray RayCamera::clipped(const Vec3& origin, const Vec3& direction) const {
  const float cosine = direction.dot(axis_);
  return {origin + direction * (near_ / cosine), direction, (far_ - near_) / cosine};
}

Ray RayCamera::rayThrough(const Vec2& point, const Vec2& lens) const {
  const Vec3 film = corner_ + point.x() * right_ + point.y() * down_;
  if (orthographic()) return clipped(position_ + film, axis_);
  if (kind_ == Camera::Kind::perspective) return clipped(position_, film.normalized());
  const Vec3 offset = lens.x() * lensX_ + lens.y() * lensY_;
  return clipped(position_ + offset, (film - offset / focus_).normalized());
}

CameraSample RayCamera::sample(Sampler& rng) const {
  const Vec2 offset = filter_.sample(rng.stratified2());
  return {offset, sampleLens(rng)};
}

CameraSample RayCamera::sample(const Vec2& offset, Sampler& rng) const {
  rng.skip(2);
  return {offset, sampleLens(rng)};
}

Vec2 RayCamera::sampleLens(Sampler& rng) const {
  return hasLens() ? squareToDisk(rng.stratified2()) : Vec2(Vec2::Zero());
}

float RayCamera::density(const Ray& ray, float distance) const {
  const float cosine = std::abs(pixel_.dot(ray.direction));
  if (orthographic()) return 1.0f / cosine;
  // The film plane is at distance 1 along corner_: `scale` times the direction points from the lens to it.
  const float scale = 1.0f / toFilm_.row(2).dot(ray.direction);
  const float fromLens = distance + near_ / ray.direction.dot(axis_);
  return scale * scale / (cosine * fromLens * fromLens);
}

std::optional<CameraView> RayCamera::view(const Vec3& point, const Vec2& lens) const {
  const Vec3 offset = hasLens() ? Vec3(lens.x() * lensX_ + lens.y() * lensY_) : Vec3(Vec3::Zero());
  const Vec3 toPoint = point - position_ - (orthographic() ? corner_ : offset);
  const Vec3 onFilm = toFilm_ * toPoint;
  const float depth = orthographic() ? onFilm.z() : toPoint.dot(axis_);
  if (!(depth > near_ && depth <= far_)) return std::nullopt;
  CameraView view;
  view.film = onFilm.head<2>();
  if (!orthographic()) view.film = view.film / onFilm.z() + (toFilm_ * (offset / focus_)).head<2>();
  const Eigen::Array2f size(width_, height_), margin = Eigen::Array2f::Constant(filter_.radius());
  if (!(view.film.array() > -margin).all() || !(view.film.array() < size + margin).all()) return std::nullopt;
  view.ray = rayThrough(view.film, lens);
  view.ray.tfar = (point - view.ray.origin).norm();
  view.density = density(view.ray, view.ray.tfar);
  return view;
}

}  // namespace lobe
