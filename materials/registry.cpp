#include "materials/registry.h"

#include <array>

#include <fmt/format.h>

#include "materials/models.h"

namespace lobe {
namespace {

struct Entry {
  std::string_view type;
  BsdfPtr (*make)(const Parameters&);
};

// Sorted by name, as knownBsdfs() guarantees.
constexpr std::array kModels = {
    Entry{"blendbsdf", makeBlend},
    Entry{"bumpmap", makeBumpMap},
    Entry{"coating", makeCoating},
    Entry{"conductor", makeConductor},
    Entry{"dielectric", makeDielectric},
    Entry{"difftrans", makeDiffTrans},
    Entry{"diffuse", makeDiffuse},
    Entry{"mask", makeMask},
    Entry{"measured", makeMeasured},
    Entry{"merl", makeMerl},
    Entry{"mixturebsdf", makeMixture},
    Entry{"normalmap", makeNormalMap},
    Entry{"null", makeNull},
    Entry{"phong", makePhong},
    Entry{"plastic", makePlastic},
    Entry{"principled", makePrincipled},
    Entry{"principledthin", makePrincipledThin},
    Entry{"roughcoating", makeRoughCoating},
    Entry{"roughconductor", makeRoughConductor},
    Entry{"roughdielectric", makeRoughDielectric},
    Entry{"roughdiffuse", makeRoughDiffuse},
    Entry{"roughplastic", makeRoughPlastic},
    Entry{"thindielectric", makeThinDielectric},
    Entry{"twosided", makeTwoSided},
    Entry{"ward", makeWard},
};

}  // namespace

BsdfPtr makeBsdf(std::string_view type, const Parameters& parameters) {
  for (const Entry& entry : kModels)
    if (entry.type == type) return entry.make(parameters);
  throw ParameterError(
      "", fmt::format("unknown bsdf type \"{}\"; known types are {}", type, fmt::join(knownBsdfs(), ", ")));
}

std::vector<std::string> knownBsdfs() {
  std::vector<std::string> names;
  for (const Entry& entry : kModels) names.emplace_back(entry.type);
  return names;
}

}  // namespace lobe
