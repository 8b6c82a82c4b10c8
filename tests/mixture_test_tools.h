#pragma once
// What the tests of the mixtures share: random mixtures, quadrature over the plane, and a chi² test of a sampler of the
// plane against its density.

#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "runtime/mixture/gaussian.h"
#include "runtime/mixture/random.h"

namespace lobe {

inline Gaussian makeGaussian(float weight, Vec2 mean, float along, float across, float angle) {
  const Gaussian g{weight, 0, 0, {along * along, 0, across * across}};
  Gaussian turned = rotated(g, {std::cos(angle), std::sin(angle)});
  turned.meanX = mean.x();
  turned.meanY = mean.y();
  return turned;
}

/// Means anywhere in the disc of the given radius, widths log-uniform in [narrow, wide]; the weights sum to `mass`.
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

/// A square of the plane.
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

/// P(χ² with this many degrees of freedom > value), by Wilson and Hilferty's cube root.
inline double chi2Tail(double value, int freedom) {
  const double v = 2.0 / (9.0 * freedom);
  return 0.5 * std::erfc((std::cbrt(value / freedom) - (1 - v)) / std::sqrt(2 * v));
}

/// The p value of `samples` draws against a density that integrates to one over the plane: cells × cells bins of the
/// window, everything outside being one bin more; bins of few expected samples are pooled. 0 if a draw is not finite or
/// the density exceeds 1 in mass.
inline double chi2PValue(const Window& w, const std::function<Vec2(Rng&)>& sample,
                         const std::function<double(const Vec2&)>& pdf, int samples = 200000, int cells = 24) {
  std::vector<double> seen(static_cast<std::size_t>(cells * cells + 1));
  Rng rng(11, static_cast<std::uint64_t>(samples));
  for (int i = 0; i < samples; ++i) {
    const Vec2 y = sample(rng);
    if (!y.allFinite()) return 0;
    const Vec2 t = ((y - w.centre) / w.half + Vec2(1, 1)) * (0.5f * static_cast<float>(cells));
    const bool inside =
        t.x() >= 0 && t.y() >= 0 && t.x() < static_cast<float>(cells) && t.y() < static_cast<float>(cells);
    ++seen[inside ? static_cast<std::size_t>(static_cast<int>(t.x()) * cells + static_cast<int>(t.y()))
                  : seen.size() - 1];
  }
  double value = 0, pooledSeen = 0, pooledExpected = 0, inside = 0;
  int freedom = -1;
  const auto bin = [&](double observed, double expected) {
    pooledSeen += observed, pooledExpected += expected;
    if (pooledExpected < 10) return;
    value += (pooledSeen - pooledExpected) * (pooledSeen - pooledExpected) / pooledExpected;
    pooledSeen = pooledExpected = 0;
    ++freedom;
  };
  const float half = w.half / static_cast<float>(cells);
  for (int i = 0; i < cells; ++i) {
    for (int j = 0; j < cells; ++j) {
      const Vec2 corner(static_cast<float>(2 * i + 1 - cells), static_cast<float>(2 * j + 1 - cells));
      const double mass = integrate({w.centre + half * corner, half}, 12, pdf);
      inside += mass;
      bin(seen[static_cast<std::size_t>(i * cells + j)], samples * mass);
    }
  }
  if (!(inside < 1.001)) return 0;
  bin(seen.back(), samples * std::max(0.0, 1 - inside));
  // What is left in the pool is too little for a bin of its own; gross excess there is a failure all the same.
  if (pooledSeen > pooledExpected + 5 * std::sqrt(pooledExpected) + 10) return 0;
  return freedom < 1 ? 0 : chi2Tail(value, freedom);
}

/// A p value below this fails: 1 % over `tests` tests (Šidák).
inline double sidak(int tests) {
  return 1 - std::pow(0.99, 1.0 / tests);
}

}  // namespace lobe
