#include "runtime/render/lights/environment_light.h"

#include <algorithm>
#include <cmath>

namespace lobe {
namespace {

/// The cell of n that contains x, or the nearest one; the first for NaN.
int cellOf(float x, int n) {
  return x >= 0.0f ? std::min(static_cast<int>(x), n - 1) : 0;
}

Rgb usable(const Rgb& c) {
  Rgb result = c;
  for (float& value : result)
    if (!(value > 0.0f) || !std::isfinite(value)) value = 0.0f;
  return result;
}

// Samples the density 1 − |x| over [−1, 1]; u uniform in [0,1).
float sampleTent(float u) {
  return u < 0.5f ? std::sqrt(2.0f * u) - 1.0f : 1.0f - std::sqrt(2.0f - 2.0f * u);
}

}  // namespace

EnvironmentLight::EnvironmentLight(const Environment& environment, float subtract)
    : width_(environment.radiance.width), height_(environment.radiance.height), toWorld_(environment.toWorld) {
  std::vector<float> rowWeights;
  std::vector<float> weights(width_);
  for (int y = 0; y < height_; ++y) {
    const float sine = std::sin(kPi * (y + 0.5f) / height_);
    for (int x = 0; x < width_; ++x) {
      const Rgb radiance = usable(environment.radiance.at(x, y));
      weights[x] = std::max(0.0f, luminance(radiance) - subtract) * sine;
      texels_.push_back({radiance.x(), radiance.y(), radiance.z(), weights[x]});
    }
    rows_.emplace_back(weights);
    rowWeights.push_back(static_cast<float>(rows_.back().total()));
  }
  rowChoice_ = DiscreteDistribution(rowWeights);
  const double pixelArea = 2.0 * kPi * kPi / static_cast<double>(texels_.size());
  flux_ = constant() ? 4.0 * kPi * luminance(texels_[0].head<3>()) : rowChoice_.total() * pixelArea;
}

EnvironmentLight EnvironmentLight::forNextEventEstimation(const Environment& environment) {
  EnvironmentLight plain(environment);
  const double mean = plain.flux() / (4.0 * kPi);
  if (plain.constant() || !std::isfinite(mean)) return plain;
  EnvironmentLight compensated(environment, static_cast<float>(mean));
  // Little is left of a nearly uniform environment, and its rounding errors would be sampled.
  return compensated.flux() > 1e-3 * plain.flux() ? compensated : plain;
}

EnvironmentLight::Coordinates EnvironmentLight::coordinates(const Vec3& direction) const {
  const Vec3 d = toWorld_.transpose() * direction;
  const float sine = std::sqrt(d.x() * d.x() + d.z() * d.z());
  const float u = std::atan2(d.x(), -d.z()) * (0.5f * kInvPi);
  const float v = std::atan2(sine, d.y()) * kInvPi;
  return {{(u < 0.0f ? u + 1.0f : u) * width_, v * height_}, sine};
}

Eigen::Vector2i EnvironmentLight::pixelOf(const Vec3& direction) const {
  const Vec2 p = coordinates(direction).point;
  return {cellOf(p.x(), width_), cellOf(p.y(), height_)};
}

// Columns wrap around, rows end at the poles.
template <class Scale>
EnvironmentLight::Texel EnvironmentLight::interpolate(const Vec2& point, const Scale& scale) const {
  const float px = point.x() - 0.5f;
  const float py = point.y() - 0.5f;
  const float floorX = std::floor(px);
  const float floorY = std::floor(py);
  const float fx = px - floorX;
  const float fy = py - floorY;
  const int left = floorX >= 0.0f ? std::min(static_cast<int>(floorX), width_ - 1) : width_ - 1;  // also for NaN
  const int right = left + 1 == width_ ? 0 : left + 1;
  const int top = cellOf(floorY, height_);
  const int bottom = cellOf(floorY + 1.0f, height_);
  const auto value = [&](int x, int y) {
    Texel result = texel(x, y);
    result.w() *= scale(x, y);
    return result;
  };
  return (1.0f - fy) * ((1.0f - fx) * value(left, top) + fx * value(right, top)) +
         fy * ((1.0f - fx) * value(left, bottom) + fx * value(right, bottom));
}

// Pixels outside the block have weight 0.
EnvironmentLight::Texel EnvironmentLight::interpolate(const Vec2& point, const PixelBlock& block) const {
  return interpolate(point, [&block](int x, int y) {
    return x < block.x0 || x >= block.x1 || y < block.y0 || y >= block.y1 ? 0.0f : 1.0f;
  });
}

// The weights of each tile sum to its probability.
EnvironmentLight::Texel EnvironmentLight::interpolate(const Vec2& point,
                                                      const CumulativeProbabilities& probabilities) const {
  return interpolate(point, [&](int x, int y) {
    const int tile = tileOf_[static_cast<std::size_t>(y) * width_ + x];
    return probabilities[tile] * tiles_[tile].inverse;
  });
}

Vec3 EnvironmentLight::direction(const Coordinates& c) const {
  const float azimuth = 2.0f * kPi * c.point.x() / width_;
  const float polar = kPi * c.point.y() / height_;
  return toWorld_ * Vec3(std::sin(azimuth) * c.sine, std::cos(polar), -std::cos(azimuth) * c.sine);
}

Rgb EnvironmentLight::radiance(const Vec3& direction) const {
  if (constant()) return texels_[0].head<3>();
  return interpolate(coordinates(direction).point, everything()).head<3>();
}

double EnvironmentLight::blockWeight(const PixelBlock& block) const {
  if (block.x0 == 0 && block.x1 == width_) return rowChoice_.mass(block.y0, block.y1);
  double sum = 0;
  for (int y = block.y0; y < block.y1; ++y) sum += rows_[y].mass(block.x0, block.x1);
  return sum;
}

int EnvironmentLight::sampleRow(const PixelBlock& block, float& u) const {
  if (block.x0 == 0 && block.x1 == width_) return static_cast<int>(rowChoice_.sample(u, block.y0, block.y1));
  std::vector<float> masses;
  for (int y = block.y0; y < block.y1; ++y) masses.push_back(static_cast<float>(rows_[y].mass(block.x0, block.x1)));
  return block.y0 + static_cast<int>(DiscreteDistribution(masses).sample(u));
}

// Converts an interpolated weight to a density over solid angle. total: the sum of the weights.
float EnvironmentLight::density(float weight, float sine, double total) const {
  if (sine <= 0.0f) return 0.0f;
  return static_cast<float>(weight * texels_.size() / (total * 2.0 * kPi * kPi * sine));
}

float EnvironmentLight::pdf(const PixelBlock& block, const Vec3& direction) const {
  if (constant()) return 0.25f * kInvPi;
  const Coordinates c = coordinates(direction);
  return density(interpolate(c.point, block).w(), c.sine, blockWeight(block));
}

float EnvironmentLight::pdf(const Vec3& direction) const {
  return pdf(everything(), direction);
}

std::optional<EnvironmentSample> EnvironmentLight::sample(const Vec2& u) const {
  return sample(everything(), u);
}

std::optional<EnvironmentSample> EnvironmentLight::sample(const PixelBlock& block, const Vec2& u) const {
  if (constant()) return EnvironmentSample{squareToSphere(u), texels_[0].head<3>(), 0.25f * kInvPi};
  Vec2 rest = u;
  const int y = sampleRow(block, rest.y());
  const auto x = static_cast<int>(rows_[y].sample(rest.x(), block.x0, block.x1));
  const Coordinates c = pointNear(x, y, rest);
  const Texel found = interpolate(c.point, block);
  const float pdf = density(found.w(), c.sine, blockWeight(block));
  if (!(pdf > 0.0f)) return std::nullopt;
  return EnvironmentSample{direction(c), found.head<3>(), pdf};
}

// The contribution of a pixel to the interpolated image is a tent around its centre. It wraps around at the seam and is
// reflected at the poles.
EnvironmentLight::Coordinates EnvironmentLight::pointNear(int x, int y, const Vec2& u) const {
  Coordinates c{{x + 0.5f + sampleTent(u.x()), y + 0.5f + sampleTent(u.y())}, 0.0f};
  if (c.point.x() < 0.0f) c.point.x() += width_;
  if (c.point.x() >= width_) c.point.x() -= width_;
  c.point.y() = c.point.y() > height_ ? 2.0f * height_ - c.point.y() : std::abs(c.point.y());
  c.sine = std::sin(kPi * c.point.y() / height_);
  return c;
}

// Halves the tile with the largest product of weight and extent along its longer side, so that the sun does not use up
// all tiles. Neighbouring tiles stay neighbours in the sequence, which keeps samples of the choice stratified.
void EnvironmentLight::divide(int most) {
  if (constant()) return;
  std::vector<PixelBlock> blocks{everything()};
  const auto priority = [&](const PixelBlock& b) {
    const int extent = std::max(b.x1 - b.x0, b.y1 - b.y0);
    return extent > 1 ? blockWeight(b) * extent : 0.0;
  };
  std::vector<double> priorities{priority(blocks[0])};
  while (static_cast<int>(blocks.size()) < most) {
    const auto widest = std::ranges::max_element(priorities) - priorities.begin();
    if (!(priorities[widest] > 0)) break;
    PixelBlock a = blocks[widest], b = a;
    if (a.x1 - a.x0 > a.y1 - a.y0)
      a.x1 = b.x0 = (a.x0 + a.x1) / 2;
    else
      a.y1 = b.y0 = (a.y0 + a.y1) / 2;
    blocks[widest] = a;
    priorities[widest] = priority(a);
    blocks.insert(blocks.begin() + widest + 1, b);
    priorities.insert(priorities.begin() + widest + 1, priority(b));
  }
  tileOf_.assign(texels_.size(), 0);
  for (const PixelBlock& b : blocks) {
    if (!(blockWeight(b) > 0)) continue;
    std::vector<double> masses;
    for (int y = b.y0; y < b.y1; ++y) {
      masses.push_back(rows_[y].mass(b.x0, b.x1));
      const auto row = tileOf_.begin() + static_cast<std::ptrdiff_t>(y) * width_;
      std::fill(row + b.x0, row + b.x1, static_cast<std::uint16_t>(tiles_.size()));
    }
    const DiscreteDistribution rows(masses);
    tiles_.push_back({b, rows, static_cast<float>(1 / rows.total())});
  }
}

double EnvironmentLight::tileFraction(int tile) const {
  return tiles_.empty() ? 1.0 : tiles_[tile].rows.total() / rowChoice_.total();
}

std::optional<EnvironmentSample> EnvironmentLight::sample(int tile, const Vec2& u,
                                                          const CumulativeProbabilities& probabilities) const {
  if (tiles_.empty()) {
    std::optional<EnvironmentSample> whole = sample(u);
    if (whole) whole->pdf *= probabilities[0];
    return whole;
  }
  const Tile& chosen = tiles_[tile];
  Vec2 rest = u;
  const int y = chosen.block.y0 + static_cast<int>(chosen.rows.sample(rest.y()));
  const auto x = static_cast<int>(rows_[y].sample(rest.x(), chosen.block.x0, chosen.block.x1));
  const Coordinates c = pointNear(x, y, rest);
  const Texel found = interpolate(c.point, probabilities);
  const float pdf = density(found.w(), c.sine, 1.0);
  if (!(pdf > 0.0f)) return std::nullopt;
  return EnvironmentSample{direction(c), found.head<3>(), pdf};
}

float EnvironmentLight::pdf(const Vec3& direction, const CumulativeProbabilities& probabilities) const {
  if (tiles_.empty()) return probabilities[0] * pdf(direction);
  const Coordinates c = coordinates(direction);
  return density(interpolate(c.point, probabilities).w(), c.sine, 1.0);
}

}  // namespace lobe
