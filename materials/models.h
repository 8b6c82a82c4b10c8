#pragma once
// Internal to materials/: the factory of every model, for the table in registry.cpp. Each throws ParameterError.

#include "materials/parameters.h"

namespace lobe {

BsdfPtr makeBumpMap(const Parameters& parameters);
BsdfPtr makeConductor(const Parameters& parameters);
BsdfPtr makeDielectric(const Parameters& parameters);
BsdfPtr makeDiffuse(const Parameters& parameters);
BsdfPtr makeMask(const Parameters& parameters);
BsdfPtr makePlastic(const Parameters& parameters);
BsdfPtr makeRoughConductor(const Parameters& parameters);
BsdfPtr makeRoughPlastic(const Parameters& parameters);
BsdfPtr makeThinDielectric(const Parameters& parameters);
BsdfPtr makeTwoSided(const Parameters& parameters);

}  // namespace lobe
