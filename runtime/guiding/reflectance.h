#pragma once
// The reflectance of one surface point for one outgoing direction, as a mixture for the product.

#include "runtime/mixture/packing.h"

namespace lobe {

/// ρ(y) = constant + Σ weight_k N_k(y), the luminance of the BRDF without the cosine, over the disc of a local frame.
/// Not normalised.
struct Reflectance {
  float constant = 0;  ///< albedo/π of the diffuse part
  /// ∫ ρ p dA for p = 2cosθ/π: the mass of the product with the background component of the illumination.
  float backgroundMass = 0;
  float albedo = 0;                 ///< albedo of the constant and the Gaussians
  float unrepresentableAlbedo = 0;  ///< albedo of lobes that have no Gaussians here
  GaussianStore<kMaxReflectanceComponents> gaussians;
};

}  // namespace lobe
