#include "materials/adapters/coating_parameters.h"

#include <cmath>

#include <fmt/format.h>

#include "materials/ior.h"
#include "materials/reflectance.h"

namespace lobe {

CoatingParameters readCoating(const Parameters& parameters) {
  const double thickness = parameters.number("thickness", 1.0);
  if (!(thickness >= 0.0 && std::isfinite(thickness)))
    throw ParameterError("thickness", fmt::format("thickness must be finite and not negative, not {}", thickness));
  BsdfPtr nested = parameters.onlyChild();
  if (nested->mapsNormals())
    parameters.warn("", "the mapped normals of the nested bsdf also apply to the coating, which should be smooth");
  return {std::move(nested), readRelativeIor(parameters, "bk7"),
          scaledTexture(parameters.texture("sigma_a", grey(0.0f)), grey(static_cast<float>(thickness))),
          readReflectance(parameters, {"specular_reflectance", grey(1.0f)})};
}

}  // namespace lobe
