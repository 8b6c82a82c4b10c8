#pragma once
// Environment light from infinity. The image is interpolated bilinearly and sampled with a density that is the bilinear
// interpolation of pixel weights (luminance × sinθ at the pixel's centre), so that radiance / density is nearly
// constant.

#include <cstdint>
#include <optional>

#include "runtime/core/distribution.h"
#include "scenes/scene.h"

namespace lobe {

struct EnvironmentSample {
  Vec3 wi;  ///< unit, world space, towards the environment
  Rgb radiance;
  float pdf;  ///< over solid angle, > 0
};

/// The probabilities of consecutive choices, cumulative: choice i has cumulative[i + 1] − cumulative[i].
class CumulativeProbabilities {
 public:
  explicit CumulativeProbabilities(const float* cumulative = nullptr) : cumulative_(cumulative) {}
  float operator[](int i) const { return cumulative_[i + 1] - cumulative_[i]; }
  CumulativeProbabilities from(int first) const { return CumulativeProbabilities(cumulative_ + first); }

 private:
  const float* cumulative_;
};

/// Pixels of columns [x0, x1) and rows [y0, y1).
struct PixelBlock {
  int x0, y0, x1, y1;
};

class EnvironmentLight {
 public:
  /// Negative and non-finite values are treated as black. Directions are sampled in proportion to
  /// max(0, luminance − subtract); the radiance stays as it is.
  explicit EnvironmentLight(const Environment& environment, float subtract = 0);

  /// The environment with a density for next-event estimation (MIS compensation, Karlík et al. 2019): directions below
  /// the mean radiance are left to BSDF sampling. The same as the plain density if that leaves nothing.
  static EnvironmentLight forNextEventEstimation(const Environment& environment);

  /// ∫ luminance dω by the quadrature of the pixel grid; 0 for a black environment.
  double flux() const { return flux_; }

  Rgb radiance(const Vec3& direction) const;

  /// Samples the whole environment by importance; u uniform in [0,1)². nullopt if the density of the direction is 0 (at
  /// the poles).
  std::optional<EnvironmentSample> sample(const Vec2& u) const;
  float pdf(const Vec3& direction) const;

  /// Like sample(u) and pdf(direction), restricted to the weights of a block of pixels; because of the interpolation a
  /// direction may be outside the block by up to one pixel. blockWeight(block) must be positive. The densities of
  /// blocks that tile the image, weighted by their fractions of the total weight, sum to pdf(direction).
  std::optional<EnvironmentSample> sample(const PixelBlock& block, const Vec2& u) const;
  float pdf(const PixelBlock& block, const Vec3& direction) const;
  double blockWeight(const PixelBlock& block) const;

  /// Divides the image into at most `most` tiles of positive weight, smaller ones where there is more weight.
  void divide(int most);
  /// At least 1; 1 before divide().
  int tiles() const { return tiles_.empty() ? 1 : static_cast<int>(tiles_.size()); }
  /// The fraction of a tile in the weight of the image.
  double tileFraction(int tile) const;
  /// Samples a tile in proportion to the weights of its pixels. The density is that of choosing a tile with the given
  /// probabilities and then a direction in it, which is what pdf returns for any direction. nullopt as above.
  std::optional<EnvironmentSample> sample(int tile, const Vec2& u, const CumulativeProbabilities& probabilities) const;
  float pdf(const Vec3& direction, const CumulativeProbabilities& probabilities) const;

  int width() const { return width_; }
  int height() const { return height_; }
  /// luminance × sinθ of a pixel.
  float weight(int x, int y) const { return texel(x, y).w(); }
  /// The pixel that contains a direction.
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

  struct Tile {
    PixelBlock block;
    DiscreteDistribution rows;
    float inverse;  // of the sum of the weights
  };

  Coordinates coordinates(const Vec3& direction) const;
  Vec3 direction(const Coordinates& c) const;
  /// The image at a point in pixels. The weight of each pixel is multiplied by scale(x, y).
  template <class Scale>
  Texel interpolate(const Vec2& point, const Scale& scale) const;
  Texel interpolate(const Vec2& point, const PixelBlock& block) const;
  Texel interpolate(const Vec2& point, const CumulativeProbabilities& probabilities) const;
  float density(float weight, float sine, double total) const;
  Coordinates pointNear(int x, int y, const Vec2& u) const;
  int sampleRow(const PixelBlock& block, float& u) const;

  int width_, height_;
  std::vector<Texel> texels_;
  Eigen::Matrix3f toWorld_;
  std::vector<DiscreteDistribution> rows_;
  DiscreteDistribution rowChoice_;  // chooses a row by the sum of its weights
  double flux_ = 0;
  std::vector<Tile> tiles_;
  std::vector<std::uint16_t> tileOf_;  // by pixel
};

}  // namespace lobe
