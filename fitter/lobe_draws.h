#pragma once
// Samples of a lobe's own sampler, with checks for invalid values.

#include <cstdint>
#include <string>
#include <vector>

#include "materials/lobe.h"

namespace lobe {

/// The message of an error: it names the lobe, the direction and the fault.
std::string faultOfLobe(const Lobe& lobe, const Vec3& wo, const std::string& fault);

/// Throws a std::runtime_error with this message.
[[noreturn]] void refuseLobe(const Lobe& lobe, const Vec3& wo, const std::string& fault);

/// ρ without the cosine. Throws std::runtime_error if the value is negative or not finite.
double lobeValue(const Lobe& lobe, const Vec3& wo, const Vec3& wi);

struct LobeDraw {
  Vec3 wi;
  double value;  ///< ρ > 0, no cosine
  double pdf;    ///< density of the lobe's sampler over solid angle
};

/// Samples first … first+count−1 of the low-discrepancy sequence, without those of value zero. Throws
/// std::runtime_error if a density is not positive and finite.
std::vector<LobeDraw> drawLobe(const Lobe& lobe, const Vec3& wo, long first, std::uint32_t count);

}  // namespace lobe
