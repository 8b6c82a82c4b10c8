#include "materials/lobes/rough_transmittance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <mutex>
#include <numbers>
#include <tuple>
#include <utility>

#include "materials/lobes/fresnel.h"

namespace lobe {
namespace {

using Vec3d = Eigen::Vector3d;

double shadowing(const Microfacet& microfacet, const Vec3d& w) {
  return microfacet.shadowingOverCosine(w) * w.z();
}

Vec3d direction(double cosine) {
  return {std::sqrt(std::max(0.0, 1.0 - cosine * cosine)), 0.0, cosine};
}

/// The fraction of light from wo that a facet with normal m refracts; eta: index of the far side over the near side.
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

/// Nodes in (0,1) and weights, which sum to one, of the Gauss–Legendre rule.
template <int count>
struct GaussRule {
  std::array<double, count> node;
  std::array<double, count> weight;

  GaussRule() {
    for (std::size_t i = 0; i < count; ++i) {
      double x = std::cos(std::numbers::pi * (static_cast<double>(i) + 0.75) / (count + 0.5));
      double slope = 1.0;
      for (int step = 0; step < 6; ++step) {  // Newton on the Legendre polynomial
        double p = x;
        double before = 1.0;
        for (int n = 2; n <= count; ++n) {
          const double next = ((2 * n - 1) * x * p - (n - 1) * before) / n;
          before = std::exchange(p, next);
        }
        slope = count * (x * p - before) / (x * x - 1.0);
        x -= p / slope;
      }
      node[i] = 0.5 * (1.0 + x);
      weight[i] = 1.0 / ((1.0 - x * x) * slope * slope);
    }
  }
};

/// The mean of fraction(microfacet, wo, m, eta) over normals m visible from wo. By symmetry about the plane of wo, half
/// of the range of the random number for the azimuth is enough. For GGX it is an angle, for which equal steps are
/// optimal; for Beckmann it is the slope perpendicular to the plane.
template <int count, typename Fraction>
double visibleMean(const Microfacet& microfacet, double cosine, double eta, const GaussRule<count>& rule,
                   const Fraction& fraction) {
  const Vec3d wo = direction(cosine);
  const bool ggx = microfacet.kind() == Microfacet::Kind::ggx;
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t j = 0; j < count; ++j) {
      const double angle = (static_cast<double>(j) + 0.5) / (2 * count);
      const double weight = rule.weight[i] * (ggx ? 1.0 / count : rule.weight[j]);
      const Eigen::Vector2d u =
          ggx ? Eigen::Vector2d(angle, rule.node[i]) : Eigen::Vector2d(rule.node[i], 0.5 * (1.0 + rule.node[j]));
      sum += weight * fraction(microfacet, wo, microfacet.sampleVisible(wo, u.cast<float>()), eta);
    }
  return sum;
}

/// 2 ∫ R(μ) μ dμ from inside. R has a kink at the critical angle, smoothed by roughness, so both sides are integrated
/// separately, over the square root of the distance from it.
double diffuseFromWithin(const Microfacet& microfacet, double eta) {
  constexpr std::size_t kCosines = 12;
  const GaussRule<kCosines> rule;
  const GaussRule<10> normals;
  const double critical = eta > 1.0 ? std::sqrt(1.0 - 1.0 / (eta * eta)) : 0.0;
  double sum = 0.0;
  for (std::size_t i = 0; i < kCosines; ++i)
    for (const double width : {-critical, 1.0 - critical}) {
      const double s = rule.node[i];
      const double mu = critical + width * s * s;
      if (width == 0.0) continue;
      sum += rule.weight[i] * 2.0 * s * std::abs(width) * 2.0 * mu *
             visibleMean(microfacet, mu, 1.0 / eta, normals, reflected);
    }
  return sum;
}

}  // namespace

RoughTransmittance::RoughTransmittance(const Microfacet& microfacet, double eta) {
  const GaussRule<8> normals;
  double mean = 0.0;
  for (int i = 0; i <= kEntries; ++i) {
    const double t = std::max(static_cast<double>(i), 1e-2) / kEntries;
    const double value = visibleMean(microfacet, t * t, eta, normals, refracted);
    table_[static_cast<std::size_t>(i)] = static_cast<float>(value);
    mean += (i == kEntries ? 0.5 : 1.0) * 4.0 * t * t * t * value / kEntries;  // μ = t², dμ = 2t dt
  }
  mean_ = static_cast<float>(std::min(mean, 1.0));
  internalReflectance_ = static_cast<float>(diffuseFromWithin(microfacet, eta));
}

float RoughTransmittance::operator()(float cosine) const {
  const float t = std::sqrt(std::clamp(cosine, 0.0f, 1.0f)) * kEntries;
  const int i = std::min(static_cast<int>(t), kEntries - 1);
  const float w = t - static_cast<float>(i);
  const auto at = static_cast<std::size_t>(i);
  return (1.0f - w) * table_[at] + w * table_[at + 1];
}

/// Scenes may have thousands of materials with few distinct interfaces, so those in use share their tables.
std::shared_ptr<const RoughTransmittance> RoughTransmittance::shared(const Microfacet& microfacet, double eta) {
  using Key = std::tuple<Microfacet::Kind, double, double>;
  static std::mutex mutex;
  static std::map<Key, std::weak_ptr<const RoughTransmittance>> tables;
  const std::lock_guard lock(mutex);
  std::weak_ptr<const RoughTransmittance>& entry = tables[{microfacet.kind(), microfacet.alphaU(), eta}];
  std::shared_ptr<const RoughTransmittance> table = entry.lock();
  if (!table) entry = table = std::make_shared<const RoughTransmittance>(microfacet, eta);
  return table;
}

VaryingTransmittance::VaryingTransmittance(const Roughness& roughness, double eta) {
  for (const Microfacet& level : roughness.levels()) {
    const double alpha = std::sqrt(level.alphaU() * level.alphaV());
    levels_.push_back(RoughTransmittance::shared(Microfacet(level.kind(), alpha, alpha), eta));
  }
}

}  // namespace lobe
