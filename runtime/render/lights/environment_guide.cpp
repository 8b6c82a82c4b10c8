#include "runtime/render/lights/environment_guide.h"

namespace lobe {

EnvironmentGuide::EnvironmentGuide(const Lights& lights)
    : lights_(lights),
      environment_(*lights.environment()),
      weights_(static_cast<std::size_t>(kBlockColumns) * kBlockRows * kCells * kCells) {}

PixelBlock EnvironmentGuide::block(int index) const {
  const int column = index % kBlockColumns, row = index / kBlockColumns;
  const int width = environment_.width(), height = environment_.height();
  return {column * width / kBlockColumns, row * height / kBlockRows, (column + 1) * width / kBlockColumns,
          (row + 1) * height / kBlockRows};
}

int EnvironmentGuide::blockOf(const Vec3& wi) const {
  // Inverts the integer division in block(): the last block that begins at or before the pixel.
  const Eigen::Vector2i pixel = environment_.pixelOf(wi);
  const int column = ((pixel.x() + 1) * kBlockColumns - 1) / environment_.width();
  const int row = ((pixel.y() + 1) * kBlockRows - 1) / environment_.height();
  return row * kBlockColumns + column;
}

int EnvironmentGuide::cellOf(const Vec2& u) {
  return static_cast<int>(u.y() * kCells) * kCells + static_cast<int>(u.x() * kCells);
}

void EnvironmentGuide::learn(const Vec3& point, const Vec3& wi, float weight) {
  const std::optional<Vec2> at = lights_.region().coordinates(point, wi);
  if (!at) return;
  // Few importons leave the scene, so each also contributes to the neighbouring cells. Otherwise the first photons of
  // cells that few importons have reached would outweigh all others.
  const Vec2& u = *at;
  const int first = blockOf(wi) * kCells * kCells;
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx) {
      const int x = std::clamp(static_cast<int>(u.x() * kCells) + dx, 0, kCells - 1);
      const int y = (static_cast<int>(u.y() * kCells) + dy + kCells) % kCells;  // the azimuth wraps around
      const int bin = first + y * kCells + x;
      float& total = weights_[static_cast<std::size_t>(bin)];
      if (total == 0) bins_.push_back(bin);
      total += weight / static_cast<float>((1 + std::abs(dx)) * (1 + std::abs(dy)) * 4);
    }
}

void EnvironmentGuide::update() {
  std::vector<double> weights;
  weights.reserve(bins_.size());
  for (const int bin : bins_) weights.push_back(weights_[static_cast<std::size_t>(bin)]);
  choice_ = DiscreteDistribution(weights);
}

std::optional<EmittedPhoton> EnvironmentGuide::sample(double choice, const Vec2& u1, const Vec2& u2) const {
  if (!(choice_.total() > 0)) return lights_.photonFromEnvironment(u1, u2);
  const std::size_t chosen = choice_.sample(choice);
  const int bin = bins_[chosen];
  const int index = bin / (kCells * kCells), cell = bin % (kCells * kCells);
  const PixelBlock pixels = block(index);
  if (environment_.blockWeight(pixels) <= 0) return std::nullopt;
  const std::optional<EnvironmentSample> from = environment_.sample(pixels, u1);
  // Interpolation can move a direction across the border of a block; such directions are covered by the neighbouring
  // block.
  if (!from || blockOf(from->wi) != index) return std::nullopt;
  const int row = cell / kCells;
  const Vec2 corner(static_cast<float>(cell % kCells), static_cast<float>(row));
  const Vec2 u = ((corner + u2) / kCells).cwiseMin(kOneMinusEpsilon);
  const float pdf = choice_.probability(chosen) * kCells * kCells * from->pdf;
  if (!(pdf > 0)) return std::nullopt;
  return lights_.photonFromEnvironment({from->wi, from->radiance, pdf}, lights_.region(), u);
}

float EnvironmentGuide::density(const Vec3& point, const Vec3& wi) const {
  if (!(choice_.total() > 0)) return lights_.photonDensityOfEnvironment(wi);
  const std::optional<Vec2> u = lights_.region().coordinates(point, wi);
  if (!u) return 0;
  const int index = blockOf(wi);
  const auto bin = static_cast<std::size_t>(index) * kCells * kCells + static_cast<std::size_t>(cellOf(*u));
  const PixelBlock pixels = block(index);
  if (!(weights_[bin] > 0) || environment_.blockWeight(pixels) <= 0) return 0;
  const double probability = weights_[bin] / choice_.total();
  return static_cast<float>(probability) * kCells * kCells * environment_.pdf(pixels, wi) / lights_.region().discArea();
}

}  // namespace lobe
