#pragma once
// Internal to materials/: the reflection of a rough interface between two dielectrics, as a lobe.

#include <fmt/format.h>

#include "materials/lobes/fresnel.h"
#include "materials/lobes/microfacet_lobe.h"

namespace lobe {

class DielectricLobe final : public MicrofacetLobe {
 public:
  /// eta: index of the far side over that of the side of the lobe, so below 1 inside the denser medium.
  DielectricLobe(const Microfacet& microfacet, double eta) : MicrofacetLobe(microfacet), eta_(eta) {}

 private:
  std::string interfaceName() const override { return "dielectric"; }
  std::string interfaceKey() const override { return fmt::format("eta={:a}", eta_); }
  std::string interfaceSummary() const override { return fmt::format("dielectric {:.4g}", eta_); }
  double reflectance(double cosHalf) const override { return fresnelDielectric(cosHalf, eta_).reflectance; }

  double eta_;
};

}  // namespace lobe
