#pragma once
// What the fitter's tests share.

#include <string>

#include "materials/registry.h"

namespace lobe {

inline BsdfPtr roughConductor(double alphaU, double alphaV, const std::string& distribution = "ggx") {
  Parameters parameters;
  parameters.set("distribution", distribution);
  parameters.set("alpha_u", alphaU);
  parameters.set("alpha_v", alphaV);
  return makeBsdf("roughconductor", parameters);
}

}  // namespace lobe
