#include "materials/rough_transmittance.h"

#include <algorithm>
#include <cmath>

#include "materials/fresnel.h"

namespace lobe {
namespace {

using Vec3d = Eigen::Vector3d;

double shadowing(const Microfacet& microfacet, const Vec3d& w) {
  return microfacet.shadowingOverCosine(w) * w.z();
}

Vec3d direction(double cosine) {
  return {std::sqrt(std::max(0.0, 1.0 - cosine * cosine)), 0.0, cosine};
}

/// The share of light from wo that is refracted, eta being far over near side.
double refracted(const Microfacet& microfacet, const Vec3d& wo, const Vec3d& m, double eta) {
  const double c = wo.dot(m);
  const DielectricFresnel fresnel = fresnelDielectric(c, eta);
  const Vec3d wt = (c / eta - fresnel.cosTransmitted) * m - wo / eta;
  if (fresnel.reflectance >= 1.0 || wt.z() >= 0.0) return 0.0;
  return (1.0 - fresnel.reflectance) * shadowing(microfacet, Vec3d(wt.x(), wt.y(), -wt.z()));
}

double reflected(const Microfacet& microfacet, const Vec3d& wo, const Vec3d& m, double eta) {
  const double c = wo.dot(m);
  const Vec3d wr = 2.0 * c * m - wo;
  return wr.z() > 0.0 ? fresnelDielectric(c, eta).reflectance * shadowing(microfacet, wr) : 0.0;
}

/// The mean of share(microfacet, wo, m, eta) over normals m visible from wo, by the midpoint rule.
template <typename Share>
double visibleMean(const Microfacet& microfacet, double cosine, double eta, int count, const Share& share) {
  const Vec3d wo = direction(cosine);
  double sum = 0.0;
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < count; ++j) {
      const Vec2 u((static_cast<float>(i) + 0.5f) / static_cast<float>(count),
                   (static_cast<float>(j) + 0.5f) / static_cast<float>(count));
      sum += share(microfacet, wo, microfacet.sampleVisible(wo, u), eta);
    }
  return sum / (count * count);
}

}  // namespace

RoughTransmittance::RoughTransmittance(const Microfacet& microfacet, double eta) {
  constexpr int kNormals = 10;
  double mean = 0.0;
  for (int i = 0; i <= kEntries; ++i) {
    const double t = std::max(static_cast<double>(i), 1e-2) / kEntries;
    const double value = visibleMean(microfacet, t * t, eta, kNormals, refracted);
    table_[static_cast<std::size_t>(i)] = static_cast<float>(value);
    mean += (i == kEntries ? 0.5 : 1.0) * 4.0 * t * t * t * value / kEntries;  // μ = t², dμ = 2t dt
  }
  mean_ = static_cast<float>(std::min(mean, 1.0));

  constexpr int kCosines = 48;
  double internal = 0.0;
  for (int i = 0; i < kCosines; ++i) {
    const double mu = (i + 0.5) / kCosines;
    internal += 2.0 * mu * visibleMean(microfacet, mu, 1.0 / eta, kNormals, reflected) / kCosines;
  }
  internalReflectance_ = static_cast<float>(internal);
}

float RoughTransmittance::operator()(float cosine) const {
  const float t = std::sqrt(std::clamp(cosine, 0.0f, 1.0f)) * kEntries;
  const int i = std::min(static_cast<int>(t), kEntries - 1);
  const float w = t - static_cast<float>(i);
  const auto at = static_cast<std::size_t>(i);
  return (1.0f - w) * table_[at] + w * table_[at + 1];
}

}  // namespace lobe
