#include "materials/lobes/principled_specular.h"

#include <algorithm>
#include <cmath>

#include "materials/lobes/fresnel.h"

namespace lobe {
namespace {

constexpr int kCells = 32;

SpecularAverages average(const Microfacet& microfacet, double eta, double cosine) {
  constexpr int kSide = 24;  // midpoints of a grid over the square of random numbers
  const Eigen::Vector3d wo(std::sqrt(1.0 - cosine * cosine), 0.0, cosine);
  SpecularAverages sum;
  for (int i = 0; i < kSide; ++i)
    for (int k = 0; k < kSide; ++k) {
      const Vec2 u((static_cast<float>(i) + 0.5f) / kSide, (static_cast<float>(k) + 0.5f) / kSide);
      const Eigen::Vector3d h = microfacet.sampleVisible(wo, u);
      const double c = std::clamp(wo.dot(h), 0.0, 1.0);
      const double fresnel = fresnelDielectric(c, eta).reflectance;
      sum.entered += static_cast<float>(1.0 - fresnel);
      const Eigen::Vector3d wi = 2.0 * c * h - wo;
      if (!(wi.z() > 0.0)) continue;
      const double seen = microfacet.shadowingOverCosine(wi.normalized()) * wi.z();
      sum.white += static_cast<float>(seen);
      sum.schlick += static_cast<float>(seen * schlick(0.0, c, eta));
      sum.dielectric += static_cast<float>(seen * fresnel);
    }
  constexpr float kScale = 1.0f / (kSide * kSide);
  return {sum.white * kScale, sum.schlick * kScale, sum.dielectric * kScale, sum.entered * kScale};
}

}  // namespace

double schlick(double normal, double cosine, double eta) {
  const double c = eta < 1.0 ? fresnelDielectric(cosine, eta).cosTransmitted : cosine;
  return normal + (1.0 - normal) * std::pow(std::clamp(1.0 - c, 0.0, 1.0), 5);
}

SpecularTable::SpecularTable(double alpha, double eta) {
  const Microfacet microfacet(Microfacet::Kind::ggx, alpha, alpha);
  for (int i = 0; i <= kCells; ++i)
    rows_.push_back(average(microfacet, eta, std::max(1e-4, static_cast<double>(i) / kCells)));
}

SpecularAverages SpecularTable::at(float cosine) const {
  const float x = std::clamp(cosine, 0.0f, 1.0f) * kCells;
  const auto cell = static_cast<std::size_t>(std::min(x, kCells - 1.0f));
  const float t = x - static_cast<float>(cell);
  const SpecularAverages& a = rows_[cell];
  const SpecularAverages& b = rows_[cell + 1];
  return {std::lerp(a.white, b.white, t), std::lerp(a.schlick, b.schlick, t), std::lerp(a.dielectric, b.dielectric, t),
          std::lerp(a.entered, b.entered, t)};
}

}  // namespace lobe
