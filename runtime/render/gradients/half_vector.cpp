#include "runtime/render/gradients/half_vector.h"

#include <cmath>

namespace lobe {
namespace {

using Vec3d = Eigen::Vector3d;

struct Shifted {
  Vec3d wi;
  double jacobian;
};

// dω = 4 |ω·h| dh.
std::optional<Shifted> reflect(const Vec3d& wo, const Vec3d& wi, const Vec3d& shiftedWo) {
  const Vec3d half = (wo + wi).normalized();
  const double cosine = shiftedWo.dot(half);
  if (!(cosine > 0)) return std::nullopt;
  return Shifted{2 * cosine * half - shiftedWo, cosine / wo.dot(half)};
}

// dω = (wo·h + η wi·h)² / (η² |wi·h|) dh (Walter et al. 2007, Eq. 17).
double refractionDerivative(const Vec3d& wo, const Vec3d& wi, const Vec3d& half, double eta) {
  const double cosine = wi.dot(half), sum = wo.dot(half) + eta * cosine;
  return sum * sum / std::abs(cosine);
}

std::optional<Shifted> refract(const Vec3d& wo, const Vec3d& wi, double eta, const Vec3d& shiftedWo) {
  Vec3d half = (wo + eta * wi).normalized();
  if (half.dot(wo) < 0) half = -half;
  if (!(half.dot(wi) < 0)) return std::nullopt;
  const double cosine = shiftedWo.dot(half);
  const double cosTransmitted2 = 1 - (1 - cosine * cosine) / (eta * eta);
  if (!(cosine > 0 && cosTransmitted2 > 0)) return std::nullopt;
  const Vec3d shifted = (cosine / eta - std::sqrt(cosTransmitted2)) * half - shiftedWo / eta;
  return Shifted{shifted,
                 refractionDerivative(shiftedWo, shifted, half, eta) / refractionDerivative(wo, wi, half, eta)};
}

Vec3d mirrored(const Vec3d& w) {
  return {w.x(), w.y(), -w.z()};
}

std::optional<Shifted> shift(const Vec3d& wo, const Vec3d& wi, double eta, const Vec3d& shiftedWo) {
  if (wo.z() * wi.z() > 0) return reflect(wo, wi, shiftedWo);
  if (eta != 1) return refract(wo, wi, eta, shiftedWo);
  std::optional<Shifted> result = reflect(wo, mirrored(wi), shiftedWo);
  if (result) result->wi = mirrored(result->wi);
  return result;
}

Vec3d unit(const Vec3& w) {
  return w.cast<double>().normalized();
}

}  // namespace

std::optional<ShiftedDirection> copyHalfVector(const Vec3& wo, const Vec3& wi, float eta, const Vec3& shiftedWo) {
  if (!(wo.z() * shiftedWo.z() > 0)) return std::nullopt;
  const std::optional<Shifted> shifted = shift(unit(wo), unit(wi), eta, unit(shiftedWo));
  if (!shifted || !(shifted->wi.z() * wi.z() > 0) || !std::isfinite(shifted->jacobian)) return std::nullopt;
  return ShiftedDirection{shifted->wi.normalized().cast<float>(), static_cast<float>(shifted->jacobian)};
}

}  // namespace lobe
