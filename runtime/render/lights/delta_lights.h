#pragma once
// Point, spot and directional lights: emitter sampling finds each of them for certain, nothing else ever does.

#include <optional>

#include "runtime/render/lights/lights.h"

namespace lobe {

/// Emitted flux, luminance; of a directional light, what enters the sphere. Where there is a texture, it counts by its
/// mean: that is exact for a projector that shows whole periods of it.
double powerOf(const DeltaLight& light, const SceneSphere& sphere);

/// What reaches the point if nothing is in between; its pdf is 1. nullopt: nothing does.
std::optional<LightSample> illuminate(const DeltaLight& light, const Vec3& point);

/// A photon, of the flux on average: uniform over the solid angle that a point or spot light shines into, over the
/// image of a projector, or over the disc that the sphere shows to a directional one. u1, u2 in [0,1)². nullopt: a
/// photon of power zero.
std::optional<EmittedPhoton> emit(const DeltaLight& light, const SceneSphere& sphere, const Vec2& u1, const Vec2& u2);

}  // namespace lobe
