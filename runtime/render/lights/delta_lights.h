#pragma once
// Point, spot, projector and directional lights. They are found by next-event estimation only.

#include <optional>

#include "runtime/render/lights/lights.h"

namespace lobe {

/// Emitted flux, luminance; for a directional light, the flux into the sphere. Textures count by their mean, which is
/// exact for a projector that shows whole periods.
double powerOf(const DeltaLight& light, const SceneSphere& sphere);

/// The light that reaches the point if it is not occluded; its pdf is 1. nullopt: none.
std::optional<LightSample> illuminate(const DeltaLight& light, const Vec3& point);

/// Samples a photon, whose expected power is the flux: uniform over the solid angle of a point or spot light, over the
/// image of a projector, or over the disc to which the sphere projects for a directional light. u1, u2 in [0,1)².
/// nullopt: a photon of zero power.
std::optional<EmittedPhoton> emit(const DeltaLight& light, const SceneSphere& sphere, const Vec2& u1, const Vec2& u2);

/// The density with which emit samples a photon in a direction that the light lights: over solid angle, for a
/// directional light over the area of the disc.
float emissionDensity(const DeltaLight& light, const SceneSphere& sphere, const Vec3& direction);

}  // namespace lobe
