#pragma once
// The shift of a direction by copying its half vector (Kettunen et al. 2015, "Gradient-Domain Path Tracing",
// Section 5.2).

#include <optional>

#include "runtime/core/vec.h"

namespace lobe {

struct ShiftedDirection {
  Vec3 wi;         ///< unit
  float jacobian;  ///< |∂wi'/∂wi|, of the shifted direction by the given one, both over solid angle
};

/// Light is scattered from wi to wo; returns the direction that has the same half vector with shiftedWo. All directions
/// are unit and in the same local frame, in which z is the normal. eta: relative index of refraction, the side of wi
/// over that of wo, if they are on different sides; with eta = 1, transmission is reflection at a thin sheet, on the
/// other side. nullopt: total internal reflection, no facet refracts wi to wo, shiftedWo is on another side than
/// wo, or the result is on another side than wi. The shift is its own inverse: from shiftedWo to wo, the result is
/// shifted to wi.
std::optional<ShiftedDirection> copyHalfVector(const Vec3& wo, const Vec3& wi, float eta, const Vec3& shiftedWo);

}  // namespace lobe
