#pragma once
// Internal to materials/: a weighted sum of reflectance models, the base of blendbsdf and mixturebsdf.

#include <array>

#include "materials/bsdf.h"

namespace lobe {

/// Maximum number of models in one sum.
inline constexpr std::size_t kMaxParts = 8;
/// One weight per part; zero beyond the last part.
using PartWeights = std::array<float, kMaxParts>;

/// Σ weight_i part_i, separately for smooth and delta parts. The sampler chooses part i with probability proportional
/// to its weight, and within it the smooth or delta part as the part's own sampler would. lobes() concatenates those of
/// all parts; if more than kMaxLobes contribute at a point, mixture() keeps those with the largest tints.
///
/// All parts share one shading frame, so the normals mapped by the parts are averaged by weight. This is exact where
/// only one part has a weight, or where all parts agree.
class WeightedBsdf : public Bsdf {
 public:
  /// 1 to kMaxParts parts.
  explicit WeightedBsdf(std::vector<BsdfPtr> parts);

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const final;
  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const final;
  float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const final;
  std::optional<DeltaSample> sampleDelta(const Vec3& wo, const Vec2& uv, float choice) const final;
  std::optional<DeltaTransmission> deltaTransmission(const Vec3& wo, const Vec2& uv) const final;
  float deltaProbability(const Vec3& wo, const Vec2& uv) const final;
  std::span<const LobePtr> lobes() const final { return lobes_; }
  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const final;
  Rgb albedo(const Vec3& wo, const Vec2& uv) const final;
  bool transmits() const final;
  Vec3 perturbedNormal(const Vec3& wo, const Vec2& uv, const Vec3& dpdu, const Vec3& dpdv) const final;
  bool mapsNormals() const final;
  bool shadowsTerminator() const final;

 private:
  /// Each at least 0, with a positive sum. If the sum exceeds 1, energy is conserved only if the parts are dark enough.
  virtual PartWeights weights(const Vec2& uv) const = 0;

  /// The sampler's weights of the smooth and of the delta parts of all parts.
  struct Split {
    PartWeights smooth{};
    PartWeights delta{};
  };
  Split split(const Vec3& wo, const Vec2& uv) const;
  float mixedPdf(const PartWeights& smooth, const Vec3& wo, const Vec3& wi, const Vec2& uv) const;

  std::vector<BsdfPtr> parts_;
  std::vector<int> firstLobe_;  // index of each part's first lobe in lobes_
  std::vector<LobePtr> lobes_;
};

}  // namespace lobe
