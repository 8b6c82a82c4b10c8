#pragma once
// Internal to materials/: the parameters that smooth and rough coatings share.

#include "materials/parameters.h"

namespace lobe {

struct CoatingParameters {
  BsdfPtr nested;
  double eta;           ///< index of the coating over that of the outside
  TexturePtr depth;     ///< absorption coefficient times thickness
  TexturePtr specular;  ///< scales the coating's own reflection
};

/// Reads int_ior (default bk7), ext_ior, sigma_a (default 0), thickness (default 1), specular_reflectance and the only
/// nested model. Warns if that maps normals, because they also apply to the coating. Throws ParameterError if one of
/// them is invalid, e.g. a thickness that is negative or not finite.
CoatingParameters readCoating(const Parameters& parameters);

}  // namespace lobe
