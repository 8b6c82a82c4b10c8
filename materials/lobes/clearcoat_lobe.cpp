#include "materials/lobes/clearcoat_lobe.h"

#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "materials/lobes/principled_specular.h"

namespace lobe {
namespace {

using Vec3d = Eigen::Vector3d;
constexpr double kPiD = std::numbers::pi;

Vec3d unit(const Vec3& w) {
  return w.cast<double>().normalized();
}

/// Smith's G1 for GGX with α = 0.25, for a cosine in (0,1].
double shadowing(double cosine) {
  constexpr double kAlpha2 = 0.0625;
  return 2.0 * cosine / (cosine + std::sqrt(cosine * cosine + kAlpha2 * (1.0 - cosine * cosine)));
}

}  // namespace

std::string ClearcoatLobe::key() const {
  return fmt::format("{} alpha={:a} eta={:a}", model(), alpha_, eta_);
}

std::string ClearcoatLobe::summary() const {
  return fmt::format("clear coat, gtr1 α {:.4g}", alpha_);
}

double ClearcoatLobe::density(const Vec3d& h) const {
  const double a2 = alpha_ * alpha_;
  const double sine2 = h.head<2>().squaredNorm();
  return (1.0 - a2) / (-kPiD * std::log(a2) * (sine2 + a2 * h.z() * h.z()));
}

double ClearcoatLobe::eval(const Vec3& wo, const Vec3& wi) const {
  if (!(wo.z() > 0.0f && wi.z() > 0.0f)) return 0.0;
  const Vec3d o = unit(wo);
  const Vec3d i = unit(wi);
  const Vec3d h = (o + i).normalized();
  return schlick(0.04, o.dot(h), eta_) * density(h) * shadowing(o.z()) * shadowing(i.z());
}

std::optional<LobeSample> ClearcoatLobe::sample(const Vec3& wo, const Vec2& u) const {
  if (!(wo.z() > 0.0f)) return std::nullopt;
  const double a2 = alpha_ * alpha_;
  const double sine2 = (std::pow(a2, 1.0 - static_cast<double>(u.x())) - a2) / (1.0 - a2);
  const double sine = std::sqrt(std::max(0.0, sine2));
  const double phi = 2.0 * kPiD * static_cast<double>(u.y());
  const Vec3d h(sine * std::cos(phi), sine * std::sin(phi), std::sqrt(std::max(0.0, 1.0 - sine2)));
  const Vec3d o = unit(wo);
  if (!(o.dot(h) > 0.0)) return std::nullopt;
  const Vec3 wi = (2.0 * o.dot(h) * h - o).normalized().cast<float>();
  const float density = pdf(wo, wi);
  if (!(density > 0.0f)) return std::nullopt;
  return LobeSample{wi, density};
}

float ClearcoatLobe::pdf(const Vec3& wo, const Vec3& wi) const {
  if (!(wo.z() > 0.0f && wi.z() > 0.0f)) return 0.0f;
  const Vec3d o = unit(wo);
  const Vec3d h = (o + unit(wi)).normalized();
  constexpr double kSmallestCosine = 1e-6;  // keeps the density finite for directions that are never sampled
  return static_cast<float>(0.25 * density(h) * h.z() / std::max(o.dot(h), kSmallestCosine));
}

}  // namespace lobe
