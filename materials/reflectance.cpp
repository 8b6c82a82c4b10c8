#include "materials/reflectance.h"

#include <fmt/format.h>

namespace lobe {
namespace {

constexpr const char* kEnsure = "ensure_energy_conservation";
// As in Mitsuba 0.6: slightly below 1, so that some light is absorbed at every bounce.
constexpr float kScaledTo = 0.99f;

/// The factor that scales a colour with the given largest component. Warns at the parameter `name`; the text of the
/// warning starts with `what`.
float conservingScale(const Parameters& parameters, const std::string& name, const std::string& what, float largest) {
  const bool decided = parameters.has(kEnsure);
  const bool scales = parameters.flag(kEnsure, false);
  if (!(largest > 1.0f) || (decided && !scales)) return 1.0f;
  if (!scales) {
    parameters.warn(
        name, fmt::format("{} up to {:.4g}, but values above 1 create energy; it is kept (ensureEnergyConservation "
                          "would scale it)",
                          what, largest));
    return 1.0f;
  }
  const float scale = kScaledTo / largest;
  parameters.warn(name, fmt::format("{} up to {:.4g}, but values above 1 create energy; it is scaled by {:.4g} "
                                    "(ensureEnergyConservation)",
                                    what, largest, scale));
  return scale;
}

TexturePtr scaledBy(float scale, TexturePtr texture) {
  return scale == 1.0f ? std::move(texture) : scaledTexture(std::move(texture), grey(scale));
}

}  // namespace

TexturePtr readReflectance(const Parameters& parameters, const ReflectanceParameter& wanted) {
  TexturePtr texture = parameters.texture(wanted.name, wanted.fallback);
  const float scale = conservingScale(parameters, wanted.name, wanted.name + " is", texture->largest().maxCoeff());
  return scaledBy(scale, std::move(texture));
}

std::pair<TexturePtr, TexturePtr> readReflectances(const Parameters& parameters, const ReflectanceParameter& first,
                                                   const ReflectanceParameter& second) {
  TexturePtr a = parameters.texture(first.name, first.fallback);
  TexturePtr b = parameters.texture(second.name, second.fallback);
  const float largest = (a->largest() + b->largest()).maxCoeff();
  const std::string& place = parameters.has(first.name) ? first.name : second.name;
  const float scale =
      conservingScale(parameters, place, fmt::format("the sum of {} and {} is", first.name, second.name), largest);
  return {scaledBy(scale, std::move(a)), scaledBy(scale, std::move(b))};
}

}  // namespace lobe
