#pragma once
// Reference product of two mixtures, pair by pair in double precision, for the tests of the kernels.

#include <cmath>
#include <numbers>
#include <span>

#include "runtime/mixture/gaussian.h"

namespace lobe {

inline double exactNormal(double dx, double dy, double xx, double xy, double yy) {
  const double determinant = xx * yy - xy * xy;
  const double square = (yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy) / determinant;
  return std::exp(-0.5 * square) / (2 * std::numbers::pi * std::sqrt(determinant));
}

inline double exactMixture(std::span<const Gaussian> mixture, double x, double y) {
  double sum = 0;
  for (const Gaussian& g : mixture)
    sum += g.weight * exactNormal(x - g.meanX, y - g.meanY, g.cov.xx, g.cov.xy, g.cov.yy);
  return sum;
}

/// a b N(μ_a − μ_b | 0, Σ_a + Σ_b).
inline double exactPair(const Gaussian& a, const Gaussian& b) {
  const double xx = static_cast<double>(a.cov.xx) + b.cov.xx, xy = static_cast<double>(a.cov.xy) + b.cov.xy,
               yy = static_cast<double>(a.cov.yy) + b.cov.yy;
  return static_cast<double>(a.weight) * b.weight *
         exactNormal(static_cast<double>(a.meanX) - b.meanX, static_cast<double>(a.meanY) - b.meanY, xx, xy, yy);
}

inline double exactMass(std::span<const Gaussian> reflectance, double constant, std::span<const Gaussian> light) {
  double sum = 0;
  for (const Gaussian& b : light) {
    sum += constant * b.weight;
    for (const Gaussian& a : reflectance) sum += exactPair(a, b);
  }
  return sum;
}

/// The product's density as a mixture over all pairs of components, each with its own mean and covariance (the form of
/// Herholz et al. 2016), without evaluating the factors.
inline double exactProductPdf(std::span<const Gaussian> reflectance, std::span<const Gaussian> light, double x,
                              double y) {
  double sum = 0;
  for (const Gaussian& a : reflectance) {
    for (const Gaussian& b : light) {
      const auto inverse = [](const Covariance& c) {
        const double det = static_cast<double>(c.xx) * c.yy - static_cast<double>(c.xy) * c.xy;
        return std::array{c.yy / det, -c.xy / det, c.xx / det};
      };
      const std::array pa = inverse(a.cov), pb = inverse(b.cov);
      const double pxx = pa[0] + pb[0], pxy = pa[1] + pb[1], pyy = pa[2] + pb[2], det = pxx * pyy - pxy * pxy;
      const double xx = pyy / det, xy = -pxy / det, yy = pxx / det;
      const double hx = pa[0] * a.meanX + pa[1] * a.meanY + pb[0] * b.meanX + pb[1] * b.meanY,
                   hy = pa[1] * a.meanX + pa[2] * a.meanY + pb[1] * b.meanX + pb[2] * b.meanY;
      sum += exactPair(a, b) * exactNormal(x - (xx * hx + xy * hy), y - (xy * hx + yy * hy), xx, xy, yy);
    }
  }
  return sum / exactMass(reflectance, 0, light);
}

}  // namespace lobe
