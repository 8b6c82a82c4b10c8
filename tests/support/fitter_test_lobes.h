#pragma once
// Lobes, directions and checks for the fitter's tests.

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <string>

#include "fitter/lobe_fit.h"
#include "materials/registry.h"

namespace lobe {

inline BsdfPtr roughConductor(double alphaU, double alphaV, const std::string& distribution = "ggx") {
  Parameters parameters;
  parameters.set("distribution", distribution);
  parameters.set("alpha_u", alphaU);
  parameters.set("alpha_v", alphaV);
  return makeBsdf("roughconductor", parameters);
}

inline LobePtr conductorLobe(double alphaU, double alphaV, const std::string& distribution = "ggx") {
  return roughConductor(alphaU, alphaV, distribution)->lobes().front();
}

inline Vec3 direction(double elevationDegrees, double azimuthDegrees = 0) {
  const double theta = elevationDegrees * std::numbers::pi / 180, phi = azimuthDegrees * std::numbers::pi / 180;
  return Vec3(static_cast<float>(std::sin(theta) * std::cos(phi)), static_cast<float>(std::sin(theta) * std::sin(phi)),
              static_cast<float>(std::cos(theta)));
}

inline void checkSound(const FittedRecord& fit) {
  double sum = 0;
  REQUIRE(!fit.mixture.empty());
  for (const Gaussian& g : fit.mixture) {
    CHECK(g.weight >= 0);
    CHECK((std::isfinite(g.meanX) && std::isfinite(g.meanY)));
    CHECK(g.mean().norm() <= 1.0f);
    CHECK(g.cov.xx > 0);
    CHECK(g.cov.determinant() > 0);
    sum += g.weight;
  }
  CHECK(sum == Approx(1).margin(1e-5));
  const CacheRecord& r = fit.record;
  for (const float v : {r.integral, r.albedo, r.cosineMass, r.outside, r.nev, r.nevCoverage, r.worstRatio})
    CHECK(std::isfinite(v));
  CHECK(r.albedo <= r.integral);
  CHECK(r.cosineMass > 0);
}

}  // namespace lobe
