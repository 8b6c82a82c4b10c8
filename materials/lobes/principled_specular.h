#pragma once
// Internal to materials/: what the principled model needs to know of its main specular lobe, a GGX interface.

#include <string>
#include <vector>

#include "materials/lobes/microfacet_lobe.h"

namespace lobe {

/// Schlick's reflectance from that at normal incidence. cosine: of the incident direction, in [0,1]. eta: far side over
/// near side; below 1 the formula takes the refracted angle.
double schlick(double normal, double cosine, double eta);

/// The interface as if it reflected everything: what is fitted, its colour being a matter of the point on the surface.
class WhiteLobe final : public MicrofacetLobe {
 public:
  using MicrofacetLobe::MicrofacetLobe;

 private:
  std::string interfaceName() const override { return "white"; }
  std::string interfaceKey() const override { return "all"; }
  std::string interfaceSummary() const override { return "white"; }
  double reflectance(double) const override { return 1.0; }
};

/// Averages over the interface as seen under one direction.
struct SpecularAverages {
  float white = 0;       ///< albedo of WhiteLobe
  float schlick = 0;     ///< the same with Schlick's weight as reflectance
  float dielectric = 0;  ///< the same with Fresnel's
  float entered = 0;     ///< 1 − Fresnel's over visible normals: what goes through the interface, shadowing left out
};

/// Table of averages over the cosine of the viewing direction, for an isotropic GGX interface.
class SpecularTable {
 public:
  /// eta: index of the far side over that of the side that wo is on.
  SpecularTable(double alpha, double eta);
  SpecularAverages at(float cosine) const;

 private:
  std::vector<SpecularAverages> rows_;
};

}  // namespace lobe
