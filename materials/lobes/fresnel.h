#pragma once
// Reflectance of smooth interfaces for unpolarised light.

#include "runtime/core/vec.h"

namespace lobe {

struct DielectricFresnel {
  double reflectance;     ///< in [0,1]; 1 under total internal reflection
  double cosTransmitted;  ///< cosine of the refracted direction on the far side; 0 under total internal reflection
};

/// cosIncident in [0,1], eta > 0: index of the far side over index of the near side.
DielectricFresnel fresnelDielectric(double cosIncident, double eta);

/// cosIncident in [0,1]; eta and k relative to the medium outside. The result is in [0,1].
Rgb fresnelConductor(float cosIncident, const Rgb& eta, const Rgb& k);

/// Reflectance of the interface under diffuse light from the near side: 2 ∫ F(μ) μ dμ over [0,1].
double fresnelDiffuse(double eta);

}  // namespace lobe
