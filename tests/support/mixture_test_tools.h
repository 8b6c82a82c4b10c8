#pragma once
// Helpers for the tests of mixtures: random mixtures, quadrature over the plane, and a chi² test of a planar sampler
// against its density.

#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <vector>

#include "runtime/core/random.h"
#include "runtime/mixture/gaussian.h"
#include "tests/support/chi2.h"

namespace lobe {

inline Gaussian makeGaussian(float weight, Vec2 mean, float along, float across, float angle) {
  const Gaussian g{weight, 0, 0, {along * along, 0, across * across}};
  Gaussian turned = rotated(g, {std::cos(angle), std::sin(angle)});
  turned.meanX = mean.x();
  turned.meanY = mean.y();
  return turned;
}

/// Means uniform in the disc of the given radius, widths log-uniform in [narrow, wide]; the weights sum to `mass`.
inline Mixture randomMixture(Rng& rng, int count, float narrow, float wide, float radius = 0.9f, float mass = 1) {
  Mixture mixture;
  float sum = 0;
  for (int k = 0; k < count; ++k) {
    const auto width = [&] { return narrow * std::pow(wide / narrow, rng.uniform()); };
    const float r = radius * std::sqrt(rng.uniform()), phi = 2 * std::numbers::pi_v<float> * rng.uniform();
    const float along = width(), across = width();
    mixture.push_back(makeGaussian(0.1f + rng.uniform(), {r * std::cos(phi), r * std::sin(phi)}, along, across, phi));
    sum += mixture.back().weight;
  }
  for (Gaussian& g : mixture) g.weight *= mass / sum;
  return mixture;
}

/// A square in the plane.
struct Window {
  Vec2 centre;
  float half;
};

/// ∫ f dA over the window by the midpoint rule on n × n points.
template <class F>
double integrate(const Window& w, int n, const F& f) {
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const Vec2 t(2 * (static_cast<float>(i) + 0.5f) / static_cast<float>(n) - 1,
                   2 * (static_cast<float>(j) + 0.5f) / static_cast<float>(n) - 1);
      sum += f(Vec2(w.centre + w.half * t));
    }
  }
  return sum * 4.0 * w.half * w.half / (static_cast<double>(n) * n);
}

/// The p-value of a planar sampler for a density that integrates to one over the plane; of the samples outside the
/// window only the number is tested. Returns 0 if a sample is not finite.
inline double chi2PValue(const Window& w, const std::function<Vec2(Rng&)>& sample,
                         const std::function<double(const Vec2&)>& pdf) {
  Rng rng(11);
  bool finite = true;
  const auto draw = [&]() -> std::optional<Eigen::Vector2d> {
    const Vec2 y = sample(rng);
    finite = finite && y.allFinite();
    return ((y - w.centre) / (2 * w.half) + Vec2(0.5f, 0.5f)).cast<double>();
  };
  const double area = 4.0 * w.half * w.half;
  const auto density = [&](const Eigen::Vector2d& t) {
    return area * pdf(w.centre + 2 * w.half * (t.cast<float>() - Vec2(0.5f, 0.5f)));
  };
  const double p = chi2Square(draw, density, {.samples = 100000, .bins = 256}).pValue;
  return finite ? p : 0;
}

/// Significance level of one of `tests` tests for 1 % over all of them (Šidák correction).
inline double sidak(int tests) {
  return 1 - std::pow(0.99, 1.0 / tests);
}

}  // namespace lobe
