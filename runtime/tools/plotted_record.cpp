#include "runtime/tools/plotted_record.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include <Eigen/Geometry>

#include "fitter/cache_mixture.h"
#include "runtime/tools/cache_grid.h"

namespace lobe {
namespace {

// Largest half-width of an enlarged view; larger lobes are shown on the whole disc.
constexpr float kCloseView = 0.5f;
constexpr float kMargin = 1.1f;

using Box = Eigen::AlignedBox2f;

// A component belongs to the visible lobe, and not only to its tails, if its peak is at least this fraction of the peak
// of the fit; a point belongs to it if its value is at least this fraction of the peak of the target.
constexpr double kLobeFraction = 0.01;

double peakAtMeans(std::span<const Gaussian> mixture, const std::function<double(const Vec2&)>& density) {
  double peak = 0;
  for (const Gaussian& g : mixture)
    if (insideDisc(g.mean())) peak = std::max(peak, density(g.mean()));
  return peak;
}

/// Bounding box of three standard deviations around every component of the lobe, however narrow.
Box boxOfFit(std::span<const Gaussian> mixture) {
  const double peak = peakAtMeans(mixture, [&](const Vec2& y) { return mixturePdf(mixture, y); });
  Box box;
  for (const Gaussian& g : mixture) {
    if (g.weight * normalPdf(g, g.mean()) < kLobeFraction * peak) continue;
    const Vec2 reach(3 * std::sqrt(g.cov.xx), 3 * std::sqrt(g.cov.yy));
    box.extend(g.mean() - reach).extend(g.mean() + reach);
  }
  return box;
}

/// Bounding box of the target, which must be in view even if the fit misses it.
Box boxOfTarget(const PlottedRecord& subject) {
  const Panel whole{0, 0, {}};
  std::vector<std::pair<Vec2, double>> values;
  double peak = peakAtMeans(subject.mixture(), [&](const Vec2& y) { return subject.target(y); });
  forEachPixel([&](int x, int y) {
    const Vec2 point = whole.point(x, y);
    if (!insideDisc(point)) return;
    values.emplace_back(point, subject.target(point));
    peak = std::max(peak, values.back().second);
  });
  Box box;
  for (const auto& [point, value] : values)
    if (value > kLobeFraction * peak) box.extend(point);
  return box;
}

}  // namespace

PlottedRecord::PlottedRecord(const LobeCache& cache, int index, const Lobe* lobe)
    : record_(cache.records()[static_cast<std::size_t>(index)]),
      mixture_(asGaussians(cache.components(record_))),
      wo_(directionOf(cache, static_cast<std::size_t>(index))),
      lobe_(lobe),
      samples_(cache.info().settings.samples) {}

double PlottedRecord::fit(const Vec2& y) const {
  return mixturePdf(mixture_, y) * discCosine(y) / record_.cosineMass;
}

double PlottedRecord::target(const Vec2& y) const {
  if (!(record_.albedo > 0)) return 0;
  const Vec3 wi = fromDisc(y);
  return 2 * lobe_->eval(wo_, wi) * wi.z() / record_.albedo;
}

double PlottedRecord::ratio(const Vec2& y) const {
  const double f = target(y);
  const double p = kGradedBsdfFraction * 2 * lobe_->pdf(wo_, fromDisc(y)) + (1 - kGradedBsdfFraction) * fit(y);
  return p > 0 ? f / p : (f > 0 ? std::numeric_limits<double>::infinity() : 1);
}

std::optional<Quality> PlottedRecord::grade() const {
  if (!lobe_) return std::nullopt;
  return gradeMixture(*lobe_, wo_, mixture_, samples_);
}

PlotView PlottedRecord::view() const {
  Box box = boxOfFit(mixture_).intersection(Box(Vec2(-1, -1), Vec2(1, 1)));
  const auto large = [&box] { return box.sizes().maxCoeff() * kMargin > 2 * kCloseView; };
  // The target takes long to evaluate, and can only enlarge the box.
  if (hasTarget() && !large()) box.extend(boxOfTarget(*this));
  if (box.isEmpty() || large()) return {{0, 0}, kWholeDisc};
  return {box.center(), 0.5f * kMargin * box.sizes().maxCoeff()};
}

}  // namespace lobe
