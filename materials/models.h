#pragma once
// Internal to materials/: the factory of every model, for the table in registry.cpp. Each throws ParameterError.

#include "materials/parameters.h"

namespace lobe {

BsdfPtr makeBlend(const Parameters& parameters);
BsdfPtr makeBumpMap(const Parameters& parameters);
BsdfPtr makeCoating(const Parameters& parameters);
BsdfPtr makeConductor(const Parameters& parameters);
BsdfPtr makeDielectric(const Parameters& parameters);
BsdfPtr makeDiffTrans(const Parameters& parameters);
BsdfPtr makeDiffuse(const Parameters& parameters);
BsdfPtr makeMask(const Parameters& parameters);
BsdfPtr makeMeasured(const Parameters& parameters);
BsdfPtr makeMerl(const Parameters& parameters);
BsdfPtr makeMixture(const Parameters& parameters);
BsdfPtr makeNormalMap(const Parameters& parameters);
BsdfPtr makeNull(const Parameters& parameters);
BsdfPtr makePhong(const Parameters& parameters);
BsdfPtr makePlastic(const Parameters& parameters);
BsdfPtr makePrincipled(const Parameters& parameters);
BsdfPtr makePrincipledThin(const Parameters& parameters);
BsdfPtr makeRoughCoating(const Parameters& parameters);
BsdfPtr makeRoughConductor(const Parameters& parameters);
BsdfPtr makeRoughDielectric(const Parameters& parameters);
BsdfPtr makeRoughDiffuse(const Parameters& parameters);
BsdfPtr makeRoughPlastic(const Parameters& parameters);
BsdfPtr makeThinDielectric(const Parameters& parameters);
BsdfPtr makeTwoSided(const Parameters& parameters);
BsdfPtr makeWard(const Parameters& parameters);

}  // namespace lobe
