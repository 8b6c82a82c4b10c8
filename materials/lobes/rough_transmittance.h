#pragma once
// Internal to materials/: the transmittance of a rough dielectric interface under single scattering.

#include <array>
#include <functional>
#include <memory>
#include <vector>

#include "materials/lobes/roughness.h"

namespace lobe {

/// E[(1 − F) G1(w_t)] over the visible normals from outside, with the refracted direction w_t; tabulated over cosθ.
class RoughTransmittance {
 public:
  /// eta: index inside over index outside. The distribution must be isotropic. Deterministic; takes about 1 ms.
  RoughTransmittance(const Microfacet& microfacet, double eta);
  /// The same table for all callers with equal arguments, as long as one of them keeps it. Thread-safe.
  static std::shared_ptr<const RoughTransmittance> shared(const Microfacet& microfacet, double eta);

  /// Transmittance from outside for cosθ in [0,1], by linear interpolation.
  float operator()(float cosine) const;

  /// 2 ∫ T(μ) μ dμ: transmittance for diffuse light from outside.
  float mean() const { return mean_; }

  /// 2 ∫ R(μ) μ dμ with R = E[F G1(w_r)] from inside: reflectance for diffuse light from inside.
  float internalReflectance() const { return internalReflectance_; }

 private:
  static constexpr int kEntries = 64;
  std::array<float, kEntries + 1> table_;  ///< over sqrt(cosθ): dense towards grazing, where T falls to zero
  float mean_;
  float internalReflectance_;
};

/// The same for a roughness that may be textured: interpolates linearly between tables for its roughness levels. For an
/// anisotropic distribution it uses the geometric mean of both alphas.
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
    const float here = value(*levels_[level]);
    return at.next > 0.0f ? here + at.next * (value(*levels_[level + 1]) - here) : here;
  }

  std::vector<std::shared_ptr<const RoughTransmittance>> levels_;
};

}  // namespace lobe
