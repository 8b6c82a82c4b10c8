#include "materials/lobes/roughness.h"

#include <algorithm>
#include <cctype>
#include <cmath>

#include <fmt/format.h>

#include "materials/lobes/roughness_levels.h"

namespace lobe {
namespace {

constexpr double kSmallestAlpha = 1e-4;

Microfacet::Kind readKind(const Parameters& parameters) {
  std::string name = parameters.text("distribution", "beckmann");
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (name == "phong" || name == "as")
    parameters.warn("distribution", fmt::format("distribution {} is replaced by beckmann with the same alpha", name));
  if (name == "phong" || name == "as" || name == "beckmann") return Microfacet::Kind::beckmann;
  if (name == "ggx") return Microfacet::Kind::ggx;
  throw ParameterError("distribution",
                       fmt::format("unknown distribution \"{}\"; known names are beckmann, ggx, phong, as", name));
}

double readAlpha(const Parameters& parameters, std::string_view name) {
  const double alpha = parameters.number(name, 0.1);
  if (!(alpha >= 0.0 && alpha <= 10.0))
    throw ParameterError(std::string(name), fmt::format("{} must be in [0, 10], not {}", name, alpha));
  if (alpha < kSmallestAlpha)
    parameters.note(fmt::format("{} {} is too small; {} is used", name, alpha, kSmallestAlpha));
  return std::max(alpha, kSmallestAlpha);
}

/// Clamped to [kSmallestAlpha, 1]; NaN becomes kSmallestAlpha.
double clampedAlpha(float alpha) {
  return alpha > kSmallestAlpha ? std::min<double>(alpha, 1.0) : kSmallestAlpha;
}

/// A roughness as a number, or as a texture that is not constant.
struct Alpha {
  double number;
  TexturePtr texture;  ///< nullptr: constant
};

Alpha readAlphaOrTexture(const Parameters& parameters, std::string_view name) {
  if (!parameters.holdsTexture(name)) return {readAlpha(parameters, name), nullptr};
  TexturePtr texture = parameters.texture(name, grey(0.1f));
  const TextureRange range = texture->range();
  if (range.smallest == range.largest) return {clampedAlpha(range.smallest), nullptr};
  return {0.0, std::move(texture)};
}

TexturePtr asTexture(const Alpha& alpha) {
  return alpha.texture ? alpha.texture : constantTexture(grey(static_cast<float>(alpha.number)));
}

}  // namespace

Roughness Roughness::read(const Parameters& parameters) {
  const Microfacet::Kind kind = readKind(parameters);
  parameters.flag("sample_visible", true);
  const bool u = parameters.has("alpha_u");
  const bool v = parameters.has("alpha_v");
  if ((u || v) && parameters.has("alpha")) throw ParameterError("alpha", "give either alpha, or alpha_u and alpha_v");
  if (u != v) parameters.note(fmt::format("{} is missing; 0.1 is used", u ? "alpha_v" : "alpha_u"));
  const Alpha alphaU = readAlphaOrTexture(parameters, u || v ? "alpha_u" : "alpha");
  const Alpha alphaV = u || v ? readAlphaOrTexture(parameters, "alpha_v") : alphaU;
  if (alphaU.texture || alphaV.texture) return {kind, asTexture(alphaU), asTexture(alphaV)};
  return Roughness(Microfacet(kind, alphaU.number, alphaV.number));
}

Roughness::Roughness(Microfacet::Kind kind, TexturePtr alphaU, TexturePtr alphaV)
    : kind_(kind), texturedU_(std::move(alphaU)), texturedV_(std::move(alphaV)) {
  const TextureRange u = texturedU_->range(), v = texturedV_->range();
  const auto levelOf = [](float a, float b) { return levelOfRoughness(std::sqrt(clampedAlpha(a) * clampedAlpha(b))); };
  lowest_ = std::floor(levelOf(u.smallest, v.smallest));
  const int last = static_cast<int>(std::ceil(levelOf(u.largest, v.largest)));
  for (int i = static_cast<int>(lowest_); i <= last; ++i)
    levels_.emplace_back(kind, roughnessOfLevel(i), roughnessOfLevel(i));
}

LocalRoughness Roughness::at(const Vec2& uv) const {
  if (!texturedU_) return {levels_[0]};
  const double u = clampedAlpha(texturedU_->evalNumber(uv));
  const double v = texturedV_ == texturedU_ ? u : clampedAlpha(texturedV_->evalNumber(uv));
  const double last = static_cast<double>(levels_.size() - 1);
  const double level = std::clamp(levelOfRoughness(std::sqrt(u * v)) - lowest_, 0.0, last);
  const double below = std::floor(level);
  return {Microfacet(kind_, u, v), static_cast<int>(below), static_cast<float>(level - below)};
}

void addLevels(LobeMixture& mixture, int firstLobe, const LocalRoughness& roughness, float tint) {
  const auto add = [&](int level, float weight) {
    if (weight > 0.0f)
      mixture.glossy[static_cast<std::size_t>(mixture.glossyCount++)] = {firstLobe + level, weight * tint};
  };
  add(roughness.level, 1.0f - roughness.next);
  add(roughness.level + 1, roughness.next);
}

}  // namespace lobe
