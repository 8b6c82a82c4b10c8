#include "fitter/mass_slopes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/LU>

namespace lobe {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

// The mass of a Gaussian beyond this many standard deviations is neglected.
constexpr double kReach = 5;
constexpr int kLeastAzimuths = 128, kMostAzimuths = 1024;
constexpr double kAzimuthsPerElongation = 64;

// ∫ exp(−r²/2) rⁿ dr along a segment of a ray, for n = 1, 2, 3.
struct RadialMoments {
  double first = 0, second = 0, third = 0;

  static RadialMoments upTo(double r) {
    const double tail = std::exp(-0.5 * r * r);
    const double half = std::sqrt(0.5 * std::numbers::pi) * std::erf(r * std::numbers::sqrt2 / 2);
    return {1 - tail, half - r * tail, 2 - (r * r + 2) * tail};
  }
  RadialMoments operator/(double d) const { return {first / d, second / d, third / d}; }
  RadialMoments operator-(const RadialMoments& o) const {
    return {first - o.first, second - o.second, third - o.third};
  }
};

// Moments over the part of the ray mean + r·v, r > 0, inside the disc.
RadialMoments insideDisc(const Vector2d& mean, const Vector2d& v) {
  const double a = 1 - mean.squaredNorm(), b = -2 * mean.dot(v), c = -v.squaredNorm();
  const double discriminant = b * b - 4 * a * c;
  if (discriminant <= 0) return {};
  const double root = std::sqrt(discriminant);
  const double far = b > 0 ? (b + root) / (-2 * c) : 2 * a / (root - b);  // avoids cancellation
  if (far <= 0) return {};
  const double near = (b - root) / (-2 * c);
  if (a >= 0 || near <= 0) return RadialMoments::upTo(far);
  return RadialMoments::upTo(far) - RadialMoments::upTo(near);
}

int azimuthCount(const Matrix2d& factor) {
  const double elongation = 0.5 * factor.squaredNorm() / std::abs(factor.determinant());
  return static_cast<int>(
      std::clamp(kAzimuthsPerElongation * elongation, double{kLeastAzimuths}, double{kMostAzimuths}));
}

// Expectations of y = mean + factor·ζ, ζ standard normal, over the disc.
struct Expectations {
  double one = 0, cosine = 0;
  Vector2d y = Vector2d::Zero(), zeta = Vector2d::Zero();
  Matrix2d yZeta = Matrix2d::Zero(), zetaZeta = Matrix2d::Zero();  // of y ζᵀ and ζ ζᵀ
};

Expectations byQuadrature(const Vector2d& mean, const Matrix2d& factor) {
  Expectations sum;
  const int count = azimuthCount(factor);
  for (int i = 0; i < count; ++i) {
    const double phi = 2 * std::numbers::pi * (i + 0.5) / count;
    const Vector2d u(std::cos(phi), std::sin(phi)), v = factor * u;
    const RadialMoments m = insideDisc(mean, v) / count;
    sum.one += m.first;
    sum.cosine += (1 - mean.squaredNorm()) * m.first - 2 * mean.dot(v) * m.second - v.squaredNorm() * m.third;
    sum.y += m.first * mean + m.second * v;
    sum.zeta += m.second * u;
    sum.yZeta += (m.second * mean + m.third * v) * u.transpose();
    sum.zetaZeta += m.third * u * u.transpose();
  }
  return sum;
}

Matrix2d symmetric(const Matrix2d& m) {
  return 0.5 * (m + m.transpose());
}

}  // namespace

MassSlopes massSlopes(const Vector2d& mean, const Matrix2d& factor) {
  const Matrix2d zero = Matrix2d::Zero();
  if (mean.norm() + kReach * factor.norm() < 1)
    return {{1, Vector2d::Zero(), zero},
            {1 - mean.squaredNorm() - factor.squaredNorm(), -2 * mean, -Matrix2d::Identity()}};
  const Expectations e = byQuadrature(mean, factor);
  const Matrix2d inverse = factor.inverse();
  // The cosine is 0 at the edge, so there is no boundary term: the derivatives are −2 E[y] with respect to the mean and
  // −2 E[y ζᵀ] with respect to the factor.
  const MassSlope cosine{e.cosine, -2 * e.y, symmetric(-e.yZeta * inverse)};
  // For the mass without the cosine, integrate the derivatives of the normal density.
  const Matrix2d byCov = 0.5 * inverse.transpose() * (e.zetaZeta - e.one * Matrix2d::Identity()) * inverse;
  return {{e.one, inverse.transpose() * e.zeta, symmetric(byCov)}, cosine};
}

}  // namespace lobe
