#pragma once
// The reflectance of one surface point for one outgoing direction, in the form that the product needs.

#include "runtime/mixture/packing.h"

namespace lobe {

/// ρ over the disc of a local frame, without the cosine: constant + Σ weight_k N_k(y), luminance. Not normalised.
struct Reflectance {
  float constant = 0;  ///< albedo/π of the diffuse part
  /// ∫ ρ p dA for p = 2cosθ/π, the light of a uniform environment: what the product makes of the background component.
  float backgroundMass = 0;
  float albedo = 0;                 ///< of all that the other fields describe
  float unrepresentableAlbedo = 0;  ///< of lobes that they do not describe
  GaussianStore<kMaxReflectanceComponents> gaussians;
};

}  // namespace lobe
