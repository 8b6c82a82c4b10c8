#include "materials/lobes/principled_parameters.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace lobe {

TexturePtr readWeight(const Parameters& parameters, const std::string& name, float fallback) {
  TexturePtr texture = parameters.texture(name, grey(fallback));
  const Rgb mean = texture->mean();
  if (!((mean >= 0.0f).all() && (mean <= 1.0f).all()))
    throw ParameterError(name, fmt::format("{} must be in [0, 1], not {}", name, mean.maxCoeff()));
  return texture;
}

float readRate(const Parameters& parameters, const std::string& name) {
  const double rate = parameters.number(name, 1.0);
  if (!(rate >= 0.0 && rate <= 1e6))
    throw ParameterError(name, fmt::format("{} must be in [0, 1e6], not {}", name, rate));
  return static_cast<float>(rate);
}

float weightOf(const TexturePtr& texture, const Vec2& uv) {
  return std::clamp(texture->evalNumber(uv), 0.0f, 1.0f);
}

Microfacet principledInterface(float roughness, float anisotropic) {
  const double square = static_cast<double>(roughness) * roughness;
  const double aspect = std::sqrt(1.0 - 0.9 * static_cast<double>(anisotropic));
  return {Microfacet::Kind::ggx, std::max(0.001, square / aspect), std::max(0.001, square * aspect)};
}

Rgb principledHue(const Rgb& colour) {
  const float bright = luminance(colour);
  return bright > 0.0f ? Rgb(colour / bright) : Rgb(Rgb::Ones());
}

}  // namespace lobe
