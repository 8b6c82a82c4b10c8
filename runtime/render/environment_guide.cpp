#include "runtime/render/environment_guide.h"

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
  // The block of a pixel inverts the integer division above: the last one that begins at or before the pixel.
  const Eigen::Vector2i pixel = environment_.pixelOf(wi);
  const int column = ((pixel.x() + 1) * kBlockColumns - 1) / environment_.width();
  const int row = ((pixel.y() + 1) * kBlockRows - 1) / environment_.height();
  return row * kBlockColumns + column;
}

int EnvironmentGuide::cellOf(const Vec2& u) {
  return static_cast<int>(u.y() * kCells) * kCells + static_cast<int>(u.x() * kCells);
}

void EnvironmentGuide::learn(const Vec3& point, const Vec3& wi, float weight) {
  const Vec2 u = lights_.photonCoordinates(point, wi);
  weights_[static_cast<std::size_t>(blockOf(wi)) * kCells * kCells + cellOf(u)] += weight;
}

void EnvironmentGuide::update() {
  bins_ = DiscreteDistribution(weights_);
}

std::optional<EmittedPhoton> EnvironmentGuide::sample(float choice, const Vec2& u1, const Vec2& u2) const {
  const bool learnt = bins_.total() > 0;
  const float unguided = learnt ? kUnguidedShare : 1.0f;
  Vec2 u = u2;
  std::optional<EnvironmentSample> from;
  if (choice < unguided) {
    from = environment_.sample(u1);
  } else {
    choice = std::min((choice - unguided) / (1.0f - unguided), kOneMinusEpsilon);
    const auto bin = static_cast<int>(bins_.sample(choice));
    const PixelBlock pixels = block(bin / (kCells * kCells));
    if (environment_.blockWeight(pixels) <= 0) return std::nullopt;
    from = environment_.sample(pixels, u1);
    // Interpolation carries directions over a block's border; there the neighbour's photons do the work.
    if (from && blockOf(from->wi) != bin / (kCells * kCells)) return std::nullopt;
    const int cell = bin % (kCells * kCells);
    u = Vec2((cell % kCells + u2.x()) / kCells, (cell / kCells + u2.y()) / kCells).cwiseMin(kOneMinusEpsilon);
  }
  if (!from) return std::nullopt;
  float pdf = unguided * environment_.pdf(from->wi);
  if (learnt) {
    const int index = blockOf(from->wi);
    const float share = bins_.probability(static_cast<std::size_t>(index) * kCells * kCells + cellOf(u));
    if (share > 0) pdf += (1.0f - unguided) * share * kCells * kCells * environment_.pdf(block(index), from->wi);
  }
  if (!(pdf > 0)) return std::nullopt;
  return lights_.photonFromEnvironment({from->wi, from->radiance, pdf}, u);
}

}  // namespace lobe
