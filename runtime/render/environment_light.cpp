#include "runtime/render/environment_light.h"

#include <cmath>

namespace lobe {
namespace {

Rgb usable(const Rgb& c) {
  Rgb result = c;
  for (float& value : result)
    if (!(value > 0.0f) || !std::isfinite(value)) value = 0.0f;
  return result;
}

// A point of density 1 − |x| over [−1, 1], from u uniform in [0,1).
float sampleTent(float u) {
  return u < 0.5f ? std::sqrt(2.0f * u) - 1.0f : 1.0f - std::sqrt(2.0f - 2.0f * u);
}

}  // namespace

EnvironmentLight::EnvironmentLight(const Environment& environment)
    : image_(environment.radiance), toWorld_(environment.toWorld) {
  for (Rgb& pixel : image_.pixels) pixel = usable(pixel);
  std::vector<float> rowWeights;
  std::vector<float> weights(image_.width);
  for (int y = 0; y < image_.height; ++y) {
    sines_.push_back(std::sin(kPi * (y + 0.5f) / image_.height));
    for (int x = 0; x < image_.width; ++x) weights[x] = weight(x, y);
    rows_.emplace_back(weights);
    rowWeights.push_back(static_cast<float>(rows_.back().total()));
  }
  columns_ = DiscreteDistribution(rowWeights);
  const double pixelArea = 2.0 * kPi * kPi / (static_cast<double>(image_.width) * image_.height);
  flux_ = constant() ? 4.0 * kPi * luminance(image_.pixels[0]) : columns_.total() * pixelArea;
}

EnvironmentLight::Coordinates EnvironmentLight::coordinates(const Vec3& direction) const {
  const Vec3 d = toWorld_.transpose() * direction;
  const float sine = std::sqrt(d.x() * d.x() + d.z() * d.z());
  const float u = std::atan2(d.x(), -d.z()) * (0.5f * kInvPi);
  const float v = std::atan2(sine, d.y()) * kInvPi;
  return {{(u < 0.0f ? u + 1.0f : u) * image_.width, v * image_.height}, sine};
}

Eigen::Vector2i EnvironmentLight::pixelOf(const Vec3& direction) const {
  const Vec2 p = coordinates(direction).point;
  return {std::min(static_cast<int>(p.x()), image_.width - 1), std::min(static_cast<int>(p.y()), image_.height - 1)};
}

// Columns wrap around, rows end at the poles. value(x, y) is what a pixel holds.
template <class Value>
auto EnvironmentLight::interpolate(const Vec2& point, const Value& value) const {
  const float px = point.x() - 0.5f;
  const float py = point.y() - 0.5f;
  const float floorX = std::floor(px);
  const float floorY = std::floor(py);
  const float fx = px - floorX;
  const float fy = py - floorY;
  const int left = (static_cast<int>(floorX) + image_.width) % image_.width;
  const int right = left + 1 == image_.width ? 0 : left + 1;
  const int top = std::clamp(static_cast<int>(floorY), 0, image_.height - 1);
  const int bottom = std::clamp(static_cast<int>(floorY) + 1, 0, image_.height - 1);
  using Result = std::decay_t<decltype(value(0, 0))>;
  return Result((1.0f - fy) * ((1.0f - fx) * value(left, top) + fx * value(right, top)) +
                fy * ((1.0f - fx) * value(left, bottom) + fx * value(right, bottom)));
}

Vec3 EnvironmentLight::direction(const Coordinates& c) const {
  const float azimuth = 2.0f * kPi * c.point.x() / image_.width;
  const float polar = kPi * c.point.y() / image_.height;
  return toWorld_ * Vec3(std::sin(azimuth) * c.sine, std::cos(polar), -std::cos(azimuth) * c.sine);
}

Rgb EnvironmentLight::radiance(const Coordinates& c) const {
  return interpolate(c.point, [&](int x, int y) -> const Rgb& { return image_.at(x, y); });
}

Rgb EnvironmentLight::radiance(const Vec3& direction) const {
  return constant() ? image_.pixels[0] : radiance(coordinates(direction));
}

double EnvironmentLight::blockWeight(const PixelBlock& block) const {
  if (block.x0 == 0 && block.x1 == image_.width) return columns_.mass(block.y0, block.y1);
  double sum = 0;
  for (int y = block.y0; y < block.y1; ++y) sum += rows_[y].mass(block.x0, block.x1);
  return sum;
}

int EnvironmentLight::sampleRow(const PixelBlock& block, float& u) const {
  if (block.x0 == 0 && block.x1 == image_.width) return static_cast<int>(columns_.sample(u, block.y0, block.y1));
  std::vector<float> masses;
  for (int y = block.y0; y < block.y1; ++y) masses.push_back(static_cast<float>(rows_[y].mass(block.x0, block.x1)));
  return block.y0 + static_cast<int>(DiscreteDistribution(masses).sample(u));
}

float EnvironmentLight::pdf(const PixelBlock& block, const Coordinates& c) const {
  const float w = interpolate(c.point, [&](int x, int y) {
    const bool inside = x >= block.x0 && x < block.x1 && y >= block.y0 && y < block.y1;
    return inside ? weight(x, y) : 0.0f;
  });
  const double imageDensity = w * image_.pixels.size() / blockWeight(block);
  return c.sine > 0.0f ? static_cast<float>(imageDensity / (2.0 * kPi * kPi * c.sine)) : 0.0f;
}

float EnvironmentLight::pdf(const PixelBlock& block, const Vec3& direction) const {
  return constant() ? 0.25f * kInvPi : pdf(block, coordinates(direction));
}

float EnvironmentLight::pdf(const Vec3& direction) const {
  return pdf(everything(), direction);
}

std::optional<EnvironmentSample> EnvironmentLight::sample(const Vec2& u) const {
  return sample(everything(), u);
}

std::optional<EnvironmentSample> EnvironmentLight::sample(const PixelBlock& block, const Vec2& u) const {
  if (constant()) return EnvironmentSample{squareToSphere(u), image_.pixels[0], 0.25f * kInvPi};
  Vec2 rest = u;
  const int y = sampleRow(block, rest.y());
  const auto x = static_cast<int>(rows_[y].sample(rest.x(), block.x0, block.x1));
  // A pixel's share of the interpolated image is a tent about its centre: around the seam, back at the poles.
  Coordinates c{{x + 0.5f + sampleTent(rest.x()), y + 0.5f + sampleTent(rest.y())}, 0.0f};
  if (c.point.x() < 0.0f) c.point.x() += image_.width;
  if (c.point.x() >= image_.width) c.point.x() -= image_.width;
  c.point.y() = c.point.y() > image_.height ? 2.0f * image_.height - c.point.y() : std::abs(c.point.y());
  c.sine = std::sin(kPi * c.point.y() / image_.height);
  const float density = c.sine > 0.0f ? pdf(block, c) : 0.0f;
  if (!(density > 0.0f)) return std::nullopt;
  return EnvironmentSample{direction(c), radiance(c), density};
}

}  // namespace lobe
