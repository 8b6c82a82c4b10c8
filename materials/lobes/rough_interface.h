#pragma once
// Internal to materials/: the geometry of reflection and refraction by the facets of a rough interface between two
// dielectrics (Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces"), single scattering.

#include "materials/lobes/microfacet.h"

namespace lobe {

/// One pair of directions at the half vector that joins them, but for Fresnel's share and the tints.
struct FacetScattering {
  double value = 0.0;    ///< of the BSDF for radiance along wi that leaves along wo, without the cosine
  double density = 0.0;  ///< over solid angle of wi, of mirroring or bending wo at a normal visible from it
  double cosHalf = 0.0;  ///< between wo and the half vector
  bool reflects = true;
};

/// wo above the surface, wi on either side of it; eta: index below over index above, not 1. Zero where a direction lies
/// in the surface, or where no facet turns one into the other.
FacetScattering scatterAtFacets(const Microfacet& microfacet, double eta, const Vec3& wo, const Vec3& wi);

}  // namespace lobe
