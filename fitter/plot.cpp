#include "fitter/plot.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <Eigen/Geometry>

#include "fitter/cache_grid.h"
#include "fitter/cache_mixture.h"

namespace lobe {
namespace {

constexpr int kPanel = 240, kGap = 8, kRing = 6;  // pixels
constexpr Colour kPaper{1, 1, 1}, kBeyond{0.85f, 0.85f, 0.85f}, kInk{0, 0, 0}, kEllipse{1, 0.25f, 0.2f};
// A lobe is looked at closely when this share of the disc shows it.
constexpr float kCloseView = 0.5f;
constexpr float kMargin = 1.1f;

/// Pixels of a panel and the points of the disc's plane they stand for.
struct Panel {
  int left, top;
  PlotView view;

  float step() const { return 2 * view.half / kPanel; }
  Vec2 point(int x, int y) const {
    const Vec2 fromCorner(static_cast<float>(x) + 0.5f, -static_cast<float>(y) - 0.5f);
    return view.centre + Vec2(-view.half, view.half) + step() * fromCorner;
  }
  /// In pixels from the corner, moved inside to where a ring is whole when it is out of view.
  Vec2 pixel(const Vec2& y) const {
    const Vec2 d = (y - view.centre) / step();
    const float middle = 0.5f * kPanel, limit = d.cwiseAbs().maxCoeff() > middle ? middle - kRing - 3 : middle;
    return {middle + std::clamp(d.x(), -limit, limit), middle - std::clamp(d.y(), -limit, limit)};
  }
};

void forEachPixel(const std::function<void(int, int)>& visit) {
  for (int y = 0; y < kPanel; ++y)
    for (int x = 0; x < kPanel; ++x) visit(x, y);
}

/// How much of a pixel a line of the given width covers, `distance` pixels off.
double coverage(double distance, double width) {
  return std::clamp(0.5 * width + 0.5 - std::abs(distance), 0.0, 1.0);
}

/// A record, its lobe when there is one, and the densities over the disc of wi that are drawn.
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
  /// Target over the density of the grade; 1 where there is neither.
  double ratio(const Vec2& y) const {
    const double f = target(y);
    const double p = kDefensiveShare * 2 * lobe_->pdf(wo_, fromDisc(y)) + (1 - kDefensiveShare) * fit(y);
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

// ---- What part of the disc to show

using Box = Eigen::AlignedBox2f;

// A component belongs to the lobe, and does not only hold up its tails, when its peak is this share of the fit's; a
// point when its value is this share of the target's.
constexpr double kLobeShare = 0.01;

double peakAtMeans(std::span<const Gaussian> mixture, const std::function<double(const Vec2&)>& density) {
  double peak = 0;
  for (const Gaussian& g : mixture)
    if (insideDisc(g.mean())) peak = std::max(peak, density(g.mean()));
  return peak;
}

/// Three standard deviations of every component of the lobe, however narrow.
Box boxOfFit(std::span<const Gaussian> mixture) {
  const double peak = peakAtMeans(mixture, [&](const Vec2& y) { return mixturePdf(mixture, y); });
  Box box;
  for (const Gaussian& g : mixture) {
    if (g.weight * normalPdf(g, g.mean()) < kLobeShare * peak) continue;
    const Vec2 reach(3 * std::sqrt(g.cov.xx), 3 * std::sqrt(g.cov.yy));
    box.extend(g.mean() - reach).extend(g.mean() + reach);
  }
  return box;
}

/// A fit that is elsewhere must not hide the target.
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
    if (value > kLobeShare * peak) box.extend(point);
  return box;
}

PlotView viewOf(const Subject& subject) {
  Box box = boxOfFit(subject.mixture());
  if (subject.hasTarget()) box.extend(boxOfTarget(subject));
  box = box.intersection(Box(Vec2(-1, -1), Vec2(1, 1)));
  if (box.isEmpty() || box.sizes().maxCoeff() * kMargin > 2 * kCloseView) return {{0, 0}, 1.02f};
  return {box.center(), 0.5f * kMargin * box.sizes().maxCoeff()};
}

// ---- Drawing

using Density = std::function<double(const Vec2&)>;

double largest(const Panel& panel, const Density& density) {
  double peak = 0;
  forEachPixel([&](int x, int y) {
    const Vec2 point = panel.point(x, y);
    if (insideDisc(point)) peak = std::max(peak, density(point));
  });
  return peak;
}

void drawField(Raster& raster, const Panel& panel, const std::function<Colour(const Vec2&)>& colourOf) {
  forEachPixel([&](int x, int y) {
    const Vec2 point = panel.point(x, y);
    raster.set(panel.left + x, panel.top + y, insideDisc(point) ? colourOf(point) : kBeyond);
    const double edge = coverage((point.norm() - 1) / panel.step(), 1);
    raster.blend(panel.left + x, panel.top + y, kInk, edge);
  });
}

void drawDensity(Raster& raster, const Panel& panel, const Density& density, double peak) {
  drawField(raster, panel, [&](const Vec2& y) {
    const double value = density(y);
    return sequentialColour(value > 0 && peak > 0 ? 1 + std::log10(value / peak) / kPlotDecades : 0);
  });
}

/// Distances from the ellipse to first order: Mahalanobis distance over the length of its gradient.
void drawEllipse(Raster& raster, const Panel& panel, const Gaussian& g, double opacity) {
  const Eigen::Matrix2f cov{{g.cov.xx, g.cov.xy}, {g.cov.xy, g.cov.yy}};
  const Eigen::Matrix2d inverse = cov.cast<double>().inverse();
  forEachPixel([&](int x, int y) {
    const Eigen::Vector2d d = (panel.point(x, y) - g.mean()).cast<double>(), v = inverse * d;
    const double m = std::sqrt(std::max(0.0, d.dot(v)));
    if (!(m > 0)) return;
    const double distance = (m - 1) * m / v.norm() / panel.step();
    raster.blend(panel.left + x, panel.top + y, kEllipse, opacity * coverage(distance, 1.5));
  });
}

void drawEllipses(Raster& raster, const Panel& panel, std::span<const Gaussian> mixture) {
  const float heaviest = std::ranges::max(mixture, {}, &Gaussian::weight).weight;
  for (const Gaussian& g : mixture) drawEllipse(raster, panel, g, 0.3 + 0.7 * std::sqrt(g.weight / heaviest));
}

void drawRing(Raster& raster, const Panel& panel, const Vec2& where) {
  const Vec2 centre = panel.pixel(where);
  forEachPixel([&](int x, int y) {
    const double r = (Vec2(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f) - centre).norm();
    raster.blend(panel.left + x, panel.top + y, kPaper, coverage(r - kRing, 5));
    raster.blend(panel.left + x, panel.top + y, kInk, coverage(r - kRing, 2));
  });
}

PlotRow drawRow(Raster& raster, int top, int index, const Subject& subject) {
  const PlotView view = viewOf(subject);
  const auto panel = [&](int column) { return Panel{kGap + column * (kPanel + kGap), top, view}; };
  const Density target = [&](const Vec2& y) { return subject.target(y); };
  const Density fit = [&](const Vec2& y) { return subject.fit(y); };
  PlotRow row{index, view, largest(panel(0), fit), subject.grade()};
  const int fitColumn = subject.hasTarget() ? 1 : 0;
  if (subject.hasTarget()) {
    row.peak = std::max(row.peak, largest(panel(0), target));
    drawDensity(raster, panel(0), target, row.peak);
    drawField(raster, panel(2), [&](const Vec2& y) {
      const double ratio = subject.ratio(y);
      return divergingColour(ratio > 0 ? std::log10(ratio) / std::log10(kPlotRatio) : -1);
    });
  }
  drawDensity(raster, panel(fitColumn), fit, row.peak);
  drawEllipses(raster, panel(fitColumn), subject.mixture());
  if (row.grade && row.grade->worst > 0)
    for (int column = 0; column < 3; ++column) drawRing(raster, panel(column), toDisc(row.grade->worstAt));
  return row;
}

}  // namespace

Plot plotRecords(const LobeCache& cache, std::span<const int> records, const Lobe* lobe) {
  const int columns = lobe ? 3 : 1, rows = static_cast<int>(records.size());
  Plot plot{Raster(kGap + columns * (kPanel + kGap), kGap + rows * (kPanel + kGap), kPaper), {}};
  for (int i = 0; i < rows; ++i) {
    const int record = records[static_cast<std::size_t>(i)];
    plot.rows.push_back(drawRow(plot.raster, kGap + i * (kPanel + kGap), record, Subject(cache, record, lobe)));
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
