#include "materials/lobes/microfacet.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lobe {
namespace {

using Vec3d = Eigen::Vector3d;
constexpr double kPiD = std::numbers::pi;
constexpr double kSqrtPi = 1.7724538509055160273;

/// Inverse error function over (−1, 1) in single precision (Giles 2012, "Approximating the erfinv function").
double erfInverse(double x) {
  double w = -std::log((1.0 - x) * (1.0 + x));
  double p;
  if (w < 5.0) {
    w -= 2.5;
    p = 2.81022636e-08;
    for (const double c : {3.43273939e-07, -3.5233877e-06, -4.39150654e-06, 0.00021858087, -0.00125372503,
                           -0.00417768164, 0.246640727, 1.50140941})
      p = c + p * w;
  } else {
    w = std::sqrt(w) - 3.0;
    p = -0.000200214257;
    for (const double c : {0.000100950558, 0.00134934322, -0.00367342844, 0.00573950773, -0.0076224613, 0.00943887047,
                           1.00167406, 2.83297682})
      p = c + p * w;
  }
  return p * x;
}

/// Samples the slope, in the viewing direction, of a normal of unit roughness that is visible from (sinθ, cosθ). Its
/// density is proportional to (cosθ − x sinθ) exp(−x²) for x < cotθ. Inverts the integral
///   P(x) = cosθ √π/2 erfc(−x) + sinθ/2 exp(−x²)
/// by Halley's method inside a bracket; the initial value is Jakob's fit ("An Improved Visible Normal Sampling Routine
/// for the Beckmann Distribution", 2014).
double sampleBeckmannSlope(double sine, double cosine, double u) {
  double low = -6.0;
  double high = 6.0 * sine < cosine ? 6.0 : cosine / sine;
  const double top = std::erf(high);
  const double target = 0.5 * u * (cosine * kSqrtPi * (1.0 + top) + sine * std::exp(-high * high));

  const double theta = std::atan2(sine, cosine);
  const double power = 1.0 + theta * (-0.876 + theta * (0.4265 - 0.0594 * theta));
  const double start = top - (1.0 + top) * std::pow(1.0 - u, power);
  double x = std::clamp(erfInverse(std::clamp(start, -1.0 + 1e-12, 1.0 - 1e-12)), low, high);

  for (int i = 0; i < 32; ++i) {
    const double bell = std::exp(-x * x);
    const double error = 0.5 * (cosine * kSqrtPi * std::erfc(-x) + sine * bell) - target;
    (error > 0.0 ? high : low) = x;
    const double lean = cosine - x * sine;  // d/dx log of the density is −sinθ/lean − 2x
    const double newton = error / (lean * bell);
    const double next = x - newton / (1.0 + newton * (0.5 * sine / lean + x));
    if (next > low && next < high) {
      const double step = std::abs(next - x);
      x = next;
      if (step < 5e-4) break;  // convergence is cubic, so the error is now of the order of 1e-10
    } else {
      x = 0.5 * (low + high);
      if (high - low < 1e-7) break;
    }
  }
  return x;
}

/// Samples the slopes of a visible normal of unit roughness, for a viewing direction in the plane y = 0.
Eigen::Vector2d sampleBeckmannSlopes(double sine, double cosine, const Vec2& u) {
  const double y = 2.0 * (u.y() + 0x1p-25) - 1.0;  // centre of the cell of a 24-bit number, so never −1
  return {sampleBeckmannSlope(sine, cosine, u.x() + 0x1p-25), erfInverse(y)};
}

Vec3d visibleBeckmann(const Vec3d& stretched, const Vec2& u) {
  const double sine = std::hypot(stretched.x(), stretched.y());
  const Eigen::Vector2d slopes = sampleBeckmannSlopes(sine, stretched.z(), u);
  const double c = sine > 0.0 ? stretched.x() / sine : 1.0;
  const double s = sine > 0.0 ? stretched.y() / sine : 0.0;
  return {-(c * slopes.x() - s * slopes.y()), -(s * slopes.x() + c * slopes.y()), 1.0};
}

/// Samples a direction uniformly in a spherical cap and returns the half vector, not normalised (Dupuy and Benyoub
/// 2023, "Sampling Visible GGX Normals with Spherical Caps").
Vec3d visibleGgx(const Vec3d& stretched, const Vec2& u) {
  const double phi = 2.0 * kPiD * u.x();
  const double z = (1.0 - u.y()) * (1.0 + stretched.z()) - stretched.z();
  const double r = std::sqrt(std::max(0.0, 1.0 - z * z));
  return stretched + Vec3d(r * std::cos(phi), r * std::sin(phi), z);
}

Vec3d unit(const Vec3& w) {
  return w.cast<double>().normalized();
}

}  // namespace

double Microfacet::density(const Vec3d& m) const {
  if (m.z() <= 0.0) return 0.0;
  const double x = m.x() / alphaU_;
  const double y = m.y() / alphaV_;
  const double z2 = m.z() * m.z();
  const double norm = kPiD * alphaU_ * alphaV_;
  if (kind_ == Kind::beckmann) {
    const double e = std::exp(-(x * x + y * y) / z2);
    return e == 0.0 ? 0.0 : e / (norm * z2 * z2);
  }
  const double t = x * x + y * y + z2;
  return 1.0 / (norm * t * t);
}

double Microfacet::shadowingOverCosine(const Vec3d& w) const {
  const double r = std::hypot(alphaU_ * w.x(), alphaV_ * w.y());
  const double z = w.z();
  if (kind_ == Kind::ggx) return 2.0 / (z + std::sqrt(z * z + r * r));
  // 1/(z + zΛ) with zΛ = r exp(−a²)/(2√π) − z erfc(a)/2, a = z/r. For a > 6, Λ is below 1e−17.
  if (z >= 6.0 * r) return 1.0 / z;
  const double a = z / r;
  return 1.0 / (z + r * std::exp(-a * a) / (2.0 * kSqrtPi) - 0.5 * z * std::erfc(a));
}

Vec3d Microfacet::sampleVisible(const Vec3d& wo, const Vec2& u) const {
  const Vec3d stretched = Vec3d(alphaU_ * wo.x(), alphaV_ * wo.y(), wo.z()).normalized();
  const Vec3d m = kind_ == Kind::ggx ? visibleGgx(stretched, u) : visibleBeckmann(stretched, u);
  return Vec3d(alphaU_ * m.x(), alphaV_ * m.y(), m.z()).normalized();
}

double Microfacet::reflection(const Vec3& wo, const Vec3& wi, double* cosHalf) const {
  if (!(wo.z() > 0.0f && wi.z() > 0.0f)) return 0.0;
  const Vec3d o = unit(wo);
  const Vec3d i = unit(wi);
  const Vec3d m = (o + i).normalized();
  if (cosHalf) *cosHalf = i.dot(m);
  return 0.25 * density(m) * shadowingOverCosine(o) * shadowingOverCosine(i);
}

std::optional<Vec3> Microfacet::sampleReflection(const Vec3& wo, const Vec2& u) const {
  if (!(wo.z() > 0.0f)) return std::nullopt;
  const Vec3d o = unit(wo);
  const Vec3d m = sampleVisible(o, u);
  const Vec3 wi = (2.0 * o.dot(m) * m - o).normalized().cast<float>();
  if (!(wi.z() > 0.0f)) return std::nullopt;
  return wi;
}

double Microfacet::reflectionPdf(const Vec3& wo, const Vec3& wi) const {
  if (!(wo.z() > 0.0f && wi.z() > 0.0f)) return 0.0;
  const Vec3d o = unit(wo);
  return 0.25 * density((o + unit(wi)).normalized()) * shadowingOverCosine(o);
}

}  // namespace lobe
