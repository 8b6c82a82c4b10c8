#pragma once
// Internal to materials/: the geometry of reflection and refraction by the facets of a rough interface between two
// dielectrics (Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces"), single scattering.

#include "materials/lobes/microfacet.h"

namespace lobe {

/// Scattering of a pair of directions at their half vector, without the Fresnel factor and the tints.
struct FacetScattering {
  double value = 0.0;    ///< of the BSDF for radiance from wi that leaves along wo, without the cosine
  double density = 0.0;  ///< over solid angle of wi, of reflecting or refracting wo at a visible normal
  double cosHalf = 0.0;  ///< between wo and the half vector
  bool reflects = true;
};

/// wo is above the surface, wi on either side of it; eta: index below over index above, not 1. Zero if a direction lies
/// in the surface plane, or if no facet scatters one into the other.
FacetScattering scatterAtFacets(const Microfacet& microfacet, double eta, const Vec3& wo, const Vec3& wi);

}  // namespace lobe
