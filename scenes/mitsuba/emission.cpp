#include "scenes/mitsuba/emission.h"

#include <fmt/format.h>

namespace lobe {

void checkEmission(const char* name, std::string_view what, const Rgb& colour) {
  // Negated, so that it also rejects NaN.
  if (!((colour >= 0.0f).all() && (colour <= kLargestEmission).all()))
    throw ParameterError(name, fmt::format("{} must be neither negative nor over {:g}, but is {} {} {}", what,
                                           kLargestEmission, colour.x(), colour.y(), colour.z()));
}

Rgb emission(const Parameters& parameters, const char* name, const Rgb& fallback) {
  Rgb colour = parameters.colour(name, fallback);
  checkEmission(name, name, colour);
  return colour;
}

TexturePtr emissionTexture(const Parameters& parameters, const char* name, const Rgb& fallback) {
  TexturePtr texture = parameters.texture(name, fallback);
  checkEmission(name, name, texture->mean());
  checkEmission(name, fmt::format("the largest {}", name), texture->largest());
  return texture;
}

double emissionScale(const Parameters& parameters, const char* name, double fallback) {
  const double scale = parameters.number(name, fallback);
  if (!(scale >= 0.0 && scale <= kLargestEmission))
    throw ParameterError(
        name, fmt::format("{} must be neither negative nor over {:g}, not {}", name, kLargestEmission, scale));
  return scale;
}

double readSamplingWeight(ReadContext& context, pugi::xml_node node, const Parameters& parameters) {
  if (!parameters.has("sampling_weight")) return 1.0;
  const double weight = parameters.number("sampling_weight", 1.0);
  if (!(weight >= 0.0))
    throw ParameterError("sampling_weight", fmt::format("sampling_weight must not be negative, but is {}", weight));
  context.findings.noteWithoutEffect(describe(node), "sampling_weight");
  return weight;
}

}  // namespace lobe
