#include "fitter/disc_mass.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lobe {
namespace {

// Along the ray mean + r·v with v = L (cos φ, sin φ), N dA = exp(−r²/2) r dr dφ / 2π, and the cosine is the parabola
// a + b r + c r².
struct Parabola {
  double a, b, c;

  /// ∫_0^r exp(−s²/2) s ds, and the same integral with the parabola as a factor.
  DiscMass upTo(double r) const {
    const double tail = std::exp(-0.5 * r * r);
    const double second = std::sqrt(0.5 * std::numbers::pi) * std::erf(r * std::numbers::sqrt2 / 2) - r * tail;
    return {1 - tail, a * (1 - tail) + b * second + c * (2 - (r * r + 2) * tail)};
  }
};

/// The integrals over the part of a ray inside the disc, where the parabola is positive.
DiscMass alongRay(const Parabola& p) {
  const double discriminant = p.b * p.b - 4 * p.a * p.c;
  if (discriminant <= 0) return {0, 0};
  const double root = std::sqrt(discriminant);
  // c < 0; this form of the far root avoids cancellation.
  const double far = p.b > 0 ? (p.b + root) / (-2 * p.c) : 2 * p.a / (root - p.b);
  if (far <= 0) return {0, 0};
  DiscMass mass = p.upTo(far);
  const double near = (p.b - root) / (-2 * p.c);
  if (p.a < 0 && near > 0) {
    const DiscMass before = p.upTo(near);
    mass.inside -= before.inside;
    mass.cosine -= before.cosine;
  }
  return mass;
}

/// Number of azimuths: in whitened coordinates the disc is an ellipse that is as elongated as the Gaussian.
int azimuthCount(const Covariance& v) {
  const double trace = static_cast<double>(v.xx) + v.yy;
  const double elongation =
      0.5 * trace / std::sqrt(static_cast<double>(v.xx) * v.yy - static_cast<double>(v.xy) * v.xy);
  return static_cast<int>(std::clamp(64 * elongation, 256.0, 8192.0));
}

DiscMass normalMass(const Gaussian& g) {
  const double x = g.meanX, y = g.meanY;
  const double l11 = std::sqrt(static_cast<double>(g.cov.xx)), l21 = g.cov.xy / l11;
  const double l22 = std::sqrt(g.cov.yy - l21 * l21);
  const int count = azimuthCount(g.cov);
  DiscMass sum{0, 0};
  for (int i = 0; i < count; ++i) {
    const double phi = 2 * std::numbers::pi * (i + 0.5) / count;
    const double vx = l11 * std::cos(phi), vy = l21 * std::cos(phi) + l22 * std::sin(phi);
    const DiscMass ray = alongRay({1 - x * x - y * y, -2 * (x * vx + y * vy), -(vx * vx + vy * vy)});
    sum.inside += ray.inside;
    sum.cosine += ray.cosine;
  }
  return {sum.inside / count, sum.cosine / count};
}

}  // namespace

DiscMass discMass(std::span<const Gaussian> mixture) {
  DiscMass sum{0, 0};
  for (const Gaussian& g : mixture) {
    const DiscMass mass = normalMass(g);
    sum.inside += g.weight * mass.inside;
    sum.cosine += g.weight * mass.cosine;
  }
  return sum;
}

}  // namespace lobe
