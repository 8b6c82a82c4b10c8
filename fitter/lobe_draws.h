#pragma once
// Points of a lobe's own sampler, checked.

#include <cstdint>
#include <string>
#include <vector>

#include "materials/lobe.h"

namespace lobe {

/// Throws std::runtime_error that names the lobe, the direction and the fault.
[[noreturn]] void refuseLobe(const Lobe& lobe, const Vec3& wo, const std::string& fault);

/// ρ without the cosine. Refuses what is negative or not finite.
double lobeValue(const Lobe& lobe, const Vec3& wo, const Vec3& wi);

struct LobeDraw {
  Vec3 wi;
  double value;  ///< ρ > 0, no cosine
  double pdf;    ///< of the lobe's sampler, over solid angle
};

/// Points first … first+count−1 of the lobe's sampler, without those of value zero. Refuses densities that are not
/// positive and finite.
std::vector<LobeDraw> drawLobe(const Lobe& lobe, const Vec3& wo, long first, std::uint32_t count);

}  // namespace lobe
