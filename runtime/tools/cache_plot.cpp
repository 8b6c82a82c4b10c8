#include "runtime/tools/cache_plot.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <Eigen/Geometry>

#include "fitter/cache_mixture.h"
#include "runtime/tools/cache_grid.h"

namespace lobe {
namespace {

// Largest half-width of an enlarged view; larger lobes are shown on the whole disc.
constexpr float kCloseView = 0.5f;
constexpr float kMargin = 1.1f;

/// A record, its lobe (may be null), and the plotted densities over the disc of wi.
class Subject {
 public:
  Subject(const LobeCache& cache, int index, const Lobe* lobe)
      : record_(cache.records()[static_cast<std::size_t>(index)]),
        mixture_(asGaussians(cache.components(record_))),
        wo_(directionOf(cache, static_cast<std::size_t>(index))),
        lobe_(lobe),
        samples_(cache.info().settings.samples) {}

  std::span<const Gaussian> mixture() const { return mixture_; }
  double fit(const Vec2& y) const { return mixturePdf(mixture_, y) * discCosine(y) / record_.cosineMass; }
  double target(const Vec2& y) const {
    if (!(record_.albedo > 0)) return 0;
    const Vec3 wi = fromDisc(y);
    return 2 * lobe_->eval(wo_, wi) * wi.z() / record_.albedo;
  }
  /// Target over the graded density; 1 where both are zero.
  double ratio(const Vec2& y) const {
    const double f = target(y);
    const double p = kGradedBsdfFraction * 2 * lobe_->pdf(wo_, fromDisc(y)) + (1 - kGradedBsdfFraction) * fit(y);
    return p > 0 ? f / p : (f > 0 ? kPlotRatio : 1);
  }
  std::optional<Quality> grade() const {
    if (!lobe_) return std::nullopt;
    return gradeMixture(*lobe_, wo_, mixture_, samples_);
  }
  bool hasTarget() const { return lobe_ != nullptr; }

 private:
  const CacheRecord& record_;
  std::span<const Gaussian> mixture_;
  Vec3 wo_;
  const Lobe* lobe_;
  std::uint32_t samples_;
};

// ---- View

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
Box boxOfTarget(const Subject& subject) {
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

PlotView viewOf(const Subject& subject) {
  Box box = boxOfFit(subject.mixture());
  if (subject.hasTarget()) box.extend(boxOfTarget(subject));
  box = box.intersection(Box(Vec2(-1, -1), Vec2(1, 1)));
  if (box.isEmpty() || box.sizes().maxCoeff() * kMargin > 2 * kCloseView) return {{0, 0}, kWholeDisc};
  return {box.center(), 0.5f * kMargin * box.sizes().maxCoeff()};
}

// ---- Drawing

PlotRow drawRow(Raster& raster, int top, int index, const Subject& subject) {
  const PlotView view = viewOf(subject);
  const auto panel = [&](int column) { return Panel{kPanelGap + column * (kPanel + kPanelGap), top, view}; };
  const DiscFunction target = [&](const Vec2& y) { return subject.target(y); };
  const DiscFunction fit = [&](const Vec2& y) { return subject.fit(y); };
  PlotRow row{index, view, largest(panel(0), fit), subject.grade()};
  const int fitColumn = subject.hasTarget() ? 1 : 0;
  if (subject.hasTarget()) {
    row.peak = std::max(row.peak, largest(panel(0), target));
    drawDensity(raster, panel(0), target, row.peak, kPlotDecades);
    drawField(raster, panel(2), [&](const Vec2& y) {
      const double ratio = subject.ratio(y);
      return divergingColour(ratio > 0 ? std::log10(ratio) / std::log10(kPlotRatio) : -1);
    });
  }
  drawDensity(raster, panel(fitColumn), fit, row.peak, kPlotDecades);
  drawEllipses(raster, panel(fitColumn), subject.mixture());
  if (row.grade && row.grade->worst > 0)
    for (int column = 0; column < 3; ++column) drawRing(raster, panel(column), toDisc(row.grade->worstAt));
  return row;
}

}  // namespace

Plot plotRecords(const LobeCache& cache, std::span<const int> records, const Lobe* lobe) {
  const int columns = lobe ? 3 : 1, rows = static_cast<int>(records.size());
  Plot plot{Raster(kPanelGap + columns * (kPanel + kPanelGap), kPanelGap + rows * (kPanel + kPanelGap), kPaper), {}};
  for (int i = 0; i < rows; ++i) {
    const int record = records[static_cast<std::size_t>(i)];
    plot.rows.push_back(
        drawRow(plot.raster, kPanelGap + i * (kPanel + kPanelGap), record, Subject(cache, record, lobe)));
  }
  return plot;
}

std::vector<int> spreadRecords(int count, int rows) {
  const int shown = std::min(count, rows);
  std::vector<int> records;
  records.reserve(static_cast<std::size_t>(shown));
  for (int i = 0; i < shown; ++i) records.push_back(shown > 1 ? i * (count - 1) / (shown - 1) : count / 2);
  return records;
}

}  // namespace lobe
