#pragma once
// How much of a Gaussian of the plane lies on the disc.

#include <span>

#include "runtime/mixture/gaussian.h"

namespace lobe {

struct DiscMass {
  double inside;  ///< ∫ G dA over the unit disc
  double cosine;  ///< ∫ G cosθ dA over the unit disc, cosθ = 1 − |y|²
};

/// Of Σ weight N. By quadrature in one dimension, the azimuth about each mean; the radius is integrated in closed form.
/// Absolute error below 1e-5 for means in the disc.
DiscMass discMass(std::span<const Gaussian> mixture);

}  // namespace lobe
