#pragma once
// Internal to materials/: how much light a rough dielectric interface lets through, by single scattering.

#include <array>
#include <functional>
#include <vector>

#include "materials/lobes/roughness.h"

namespace lobe {

/// E[(1 − F) G1(w_t)] over the visible normals, w_t the refracted direction; from outside, in a table over cosθ.
class RoughTransmittance {
 public:
  /// eta: inside over outside. The distribution is isotropic. Deterministic; takes about a millisecond.
  RoughTransmittance(const Microfacet& microfacet, double eta);

  /// From outside at cosθ in [0,1]; linear between entries.
  float operator()(float cosine) const;

  /// 2 ∫ T(μ) μ dμ: of diffuse light from outside.
  float mean() const { return mean_; }

  /// 2 ∫ R(μ) μ dμ with R = E[F G1(w_r)] from within: what diffuse light from within is thrown back.
  float internalReflectance() const { return internalReflectance_; }

 private:
  static constexpr int kEntries = 64;
  std::array<float, kEntries + 1> table_;  ///< over sqrt(cosθ): dense towards grazing, where T falls to zero
  float mean_;
  float internalReflectance_;
};

/// The same for a roughness that may vary: tables at its levels, and linear between them. Where the distribution is not
/// isotropic, that of the geometric mean of its alphas.
class VaryingTransmittance {
 public:
  VaryingTransmittance(const Roughness& roughness, double eta);

  float operator()(const LocalRoughness& at, float cosine) const {
    return between(at, [cosine](const RoughTransmittance& t) { return t(cosine); });
  }
  float mean(const LocalRoughness& at) const { return between(at, std::mem_fn(&RoughTransmittance::mean)); }
  float internalReflectance(const LocalRoughness& at) const {
    return between(at, std::mem_fn(&RoughTransmittance::internalReflectance));
  }

 private:
  template <typename Value>
  float between(const LocalRoughness& at, const Value& value) const {
    const auto level = static_cast<std::size_t>(at.level);
    const float here = value(levels_[level]);
    return at.next > 0.0f ? here + at.next * (value(levels_[level + 1]) - here) : here;
  }

  std::vector<RoughTransmittance> levels_;
};

}  // namespace lobe
