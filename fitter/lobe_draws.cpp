#include "fitter/lobe_draws.h"

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "runtime/core/low_discrepancy.h"

namespace lobe {

std::string faultOfLobe(const Lobe& lobe, const Vec3& wo, const std::string& fault) {
  return fmt::format("lobe {} cannot be fitted for the direction ({}, {}, {}): {}", lobe.summary(), wo.x(), wo.y(),
                     wo.z(), fault);
}

void refuseLobe(const Lobe& lobe, const Vec3& wo, const std::string& fault) {
  throw std::runtime_error(faultOfLobe(lobe, wo, fault));
}

double lobeValue(const Lobe& lobe, const Vec3& wo, const Vec3& wi) {
  const double value = lobe.eval(wo, wi);
  if (!(value >= 0 && std::isfinite(value))) refuseLobe(lobe, wo, fmt::format("its value is {}", value));
  return value;
}

std::vector<LobeDraw> drawLobe(const Lobe& lobe, const Vec3& wo, long first, std::uint32_t count) {
  std::vector<LobeDraw> draws;
  draws.reserve(count);
  for (long i = first; i < first + static_cast<long>(count); ++i) {
    const std::optional<LobeSample> s = lobe.sample(wo, squarePoint(i));
    if (!s || s->wi.z() <= 0) continue;
    if (!(s->pdf > 0 && std::isfinite(s->pdf)))
      refuseLobe(lobe, wo, fmt::format("its sampler has the density {}", s->pdf));
    const double value = lobeValue(lobe, wo, s->wi);
    if (value > 0) draws.push_back({s->wi, value, s->pdf});
  }
  return draws;
}

}  // namespace lobe
