#pragma once
// Internal to materials/: the parameters that smooth and rough coatings share.

#include "materials/parameters.h"

namespace lobe {

struct CoatingParameters {
  BsdfPtr nested;
  double eta;           ///< index of the coating over that outside
  TexturePtr depth;     ///< absorption coefficient times thickness
  TexturePtr specular;  ///< factor on the reflection of the coating itself
};

/// int_ior (default bk7), ext_ior, sigma_a (default 0), thickness (default 1), specular_reflectance and the only nested
/// model. Warns where that maps normals, since the coating has to follow them. ParameterError: as the parts of it, or a
/// thickness that is negative or not finite.
CoatingParameters readCoating(const Parameters& parameters);

}  // namespace lobe
