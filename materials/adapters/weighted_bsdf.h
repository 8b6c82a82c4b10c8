#pragma once
// Internal to materials/: a weighted sum of reflectance models, as blends and mixtures are.

#include <array>

#include "materials/bsdf.h"

namespace lobe {

/// Most models that take part in one sum.
inline constexpr std::size_t kMaxParts = 8;
/// One number for each part; zero beyond the last.
using PartWeights = std::array<float, kMaxParts>;

/// Σ weight_i part_i, smooth parts with smooth parts and delta with delta. The sampler takes part i with a probability
/// proportional to its weight, and in it the smooth or delta part as that itself would. lobes() are those of all parts,
/// one after another; of more than kMaxLobes that take part at a point, mixture() keeps those of the largest tint.
///
/// All parts share one frame, so that normals mapped in the parts are averaged by weight: exact where only one part
/// counts, or where all parts agree.
class WeightedBsdf : public Bsdf {
 public:
  /// 1 to kMaxParts parts.
  explicit WeightedBsdf(std::vector<BsdfPtr> parts);

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const final;
  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const final;
  float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const final;
  std::optional<DeltaSample> sampleDelta(const Vec3& wo, const Vec2& uv, float choice) const final;
  float deltaProbability(const Vec3& wo, const Vec2& uv) const final;
  std::span<const LobePtr> lobes() const final { return lobes_; }
  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const final;
  Rgb albedo(const Vec3& wo, const Vec2& uv) const final;
  bool transmits() const final;
  Vec3 perturbedNormal(const Vec3& wo, const Vec2& uv, const Vec3& dpdu, const Vec3& dpdv) const final;
  bool mapsNormals() const final;
  bool shadowsTerminator() const final;

 private:
  /// At least 0 each, with a sum above 0. A sum above 1 is for dark parts: the whole may then reflect no more than it
  /// receives all the same.
  virtual PartWeights weights(const Vec2& uv) const = 0;

  /// Weights of the parts' smooth parts and of their delta parts, as the sampler chooses.
  struct Split {
    PartWeights smooth{};
    PartWeights delta{};
  };
  Split split(const Vec3& wo, const Vec2& uv) const;
  float mixedPdf(const PartWeights& smooth, const Vec3& wo, const Vec3& wi, const Vec2& uv) const;

  std::vector<BsdfPtr> parts_;
  std::vector<int> firstLobe_;  // of each part, in lobes_
  std::vector<LobePtr> lobes_;
};

}  // namespace lobe
