#pragma once
// Light from infinitely far. The image is interpolated bilinearly, and sampled by a density that is the bilinear
// interpolation of pixel weights (luminance × sinθ at the pixel's centre), so that radiance over density hardly varies.

#include <optional>

#include "runtime/core/distribution.h"
#include "scenes/scene.h"

namespace lobe {

struct EnvironmentSample {
  Vec3 wi;  ///< unit, world space, towards the environment
  Rgb radiance;
  float pdf;  ///< over solid angle, > 0
};

/// Pixels of columns [x0, x1) and rows [y0, y1).
struct PixelBlock {
  int x0, y0, x1, y1;
};

class EnvironmentLight {
 public:
  /// Values that are negative or not finite count as black.
  explicit EnvironmentLight(const Environment& environment);

  /// ∫ luminance dω, in the interpolation's own quadrature. 0: black.
  double flux() const { return flux_; }

  Rgb radiance(const Vec3& direction) const;

  /// Draws by importance from the whole environment; u uniform in [0,1)². nullopt: the direction has no density
  /// (poles).
  std::optional<EnvironmentSample> sample(const Vec2& u) const;
  float pdf(const Vec3& direction) const;

  /// The same restricted to the weights of a block of pixels; a direction may leave the block by a pixel, as far as
  /// interpolation carries its light. blockWeight(block) is positive. Densities of blocks that tile the image, weighted
  /// by their share of the weight, sum to pdf.
  std::optional<EnvironmentSample> sample(const PixelBlock& block, const Vec2& u) const;
  float pdf(const PixelBlock& block, const Vec3& direction) const;
  double blockWeight(const PixelBlock& block) const;

  int width() const { return width_; }
  int height() const { return height_; }
  /// luminance × sinθ of a pixel.
  float weight(int x, int y) const { return texel(x, y).w(); }
  /// The pixel that a direction falls into.
  Eigen::Vector2i pixelOf(const Vec3& direction) const;

 private:
  struct Coordinates {
    Vec2 point;  // in pixels
    float sine;
  };
  using Texel = Eigen::Array4f;  // radiance, then weight

  const Texel& texel(int x, int y) const { return texels_[static_cast<std::size_t>(y) * width_ + x]; }
  bool constant() const { return texels_.size() == 1; }
  PixelBlock everything() const { return {0, 0, width_, height_}; }

  Coordinates coordinates(const Vec3& direction) const;
  Vec3 direction(const Coordinates& c) const;
  Texel interpolate(const Vec2& point, const PixelBlock& block) const;
  float density(float weight, float sine, const PixelBlock& block) const;
  int sampleRow(const PixelBlock& block, float& u) const;

  int width_, height_;
  std::vector<Texel> texels_;
  Eigen::Matrix3f toWorld_;
  std::vector<DiscreteDistribution> rows_;
  DiscreteDistribution columns_;  // over rows: the weights of rows_
  double flux_ = 0;
};

}  // namespace lobe
