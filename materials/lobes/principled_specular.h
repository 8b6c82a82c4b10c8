#pragma once
// Internal to materials/: the main specular lobe of the principled model, a GGX interface, and its averages.

#include <string>
#include <vector>

#include "materials/lobes/microfacet_lobe.h"

namespace lobe {

/// Schlick's reflectance, given that at normal incidence. cosine: of the incident direction, in [0,1]. eta: index of
/// the far side over that of the near side; if below 1, the formula uses the refracted angle.
double schlick(double normal, double cosine, double eta);

/// The interface with a Fresnel term of 1. This lobe is fitted; the Fresnel term enters through the tint, which depends
/// on the surface point.
class WhiteLobe final : public MicrofacetLobe {
 public:
  using MicrofacetLobe::MicrofacetLobe;

 private:
  std::string interfaceName() const override { return "white"; }
  std::string interfaceKey() const override { return "all"; }
  std::string interfaceSummary() const override { return "white"; }
  double reflectance(double) const override { return 1.0; }
};

/// Averages over the interface for one viewing direction.
struct SpecularAverages {
  float white = 0;       ///< albedo of WhiteLobe
  float schlick = 0;     ///< the same with Schlick's weight as reflectance
  float dielectric = 0;  ///< the same with the Fresnel reflectance
  float entered = 0;     ///< mean transmittance 1 − F over visible normals, without shadowing
};

/// The averages of an isotropic GGX interface, tabulated over the cosine of the viewing direction.
class SpecularTable {
 public:
  /// eta: index of the far side over that of the side that wo is on.
  SpecularTable(double alpha, double eta);
  SpecularAverages at(float cosine) const;

 private:
  std::vector<SpecularAverages> rows_;
};

}  // namespace lobe
