#include "materials/lobes/fresnel.h"

#include <algorithm>
#include <cmath>

namespace lobe {

DielectricFresnel fresnelDielectric(double cosIncident, double eta) {
  const double c = std::clamp(cosIncident, 0.0, 1.0);
  const double cos2 = 1.0 - (1.0 - c * c) / (eta * eta);
  if (cos2 <= 0.0) return {1.0, 0.0};
  const double t = std::sqrt(cos2);
  const double parallel = (eta * c - t) / (eta * c + t);
  const double perpendicular = (c - eta * t) / (c + eta * t);
  return {0.5 * (parallel * parallel + perpendicular * perpendicular), t};
}

Rgb fresnelConductor(float cosIncident, const Rgb& eta, const Rgb& k) {
  const float c = std::clamp(cosIncident, 0.0f, 1.0f);
  const float cos2 = c * c;
  const float sin2 = 1.0f - cos2;
  const Rgb t = eta.square() - k.square() - sin2;
  const Rgb r = (t.square() + 4.0f * eta.square() * k.square()).sqrt();  // a² + b²
  const Rgb a = (0.5f * (r + t)).max(0.0f).sqrt();
  // The ratio is 0/0 at grazing incidence if eta = 1 and k = 0, and at normal incidence if both are 0; its limit is 1.
  static constexpr float kTiny = 1e-20f;
  const auto ratio = [](const Rgb& sum, const Rgb& twice) {
    return ((sum - twice + kTiny) / (sum + twice + kTiny)).eval();
  };
  const Rgb s = ratio(r + cos2, 2.0f * c * a);
  const Rgb p = s * ratio(r * cos2 + sin2 * sin2, 2.0f * c * sin2 * a);
  return (0.5f * (s + p)).max(0.0f).min(1.0f);
}

double fresnelDiffuse(double eta) {
  // The integrand from the denser side has a kink at the critical angle, but both sides are related exactly.
  if (eta < 1.0) return 1.0 - eta * eta * (1.0 - fresnelDiffuse(1.0 / eta));
  constexpr int kIntervals = 256;  // Simpson's rule over t, μ = t²
  double sum = 0.0;
  for (int i = 0; i <= kIntervals; ++i) {
    const double t = static_cast<double>(i) / kIntervals;
    const double weight = i == 0 || i == kIntervals ? 1.0 : (i % 2 ? 4.0 : 2.0);
    sum += weight * 4.0 * t * t * t * fresnelDielectric(t * t, eta).reflectance;
  }
  return sum / (3.0 * kIntervals);
}

}  // namespace lobe
