#include "runtime/tools/cache_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include <fmt/format.h>

#include "runtime/analysis/text.h"
#include "runtime/tools/cache_grid.h"
#include "runtime/tools/plotted_record.h"

namespace lobe {
namespace {

// Pixels above the panels of a row, and below them.
constexpr int kAbove = 6, kBelow = kPanelGap / 2 + kScaleHeight + 2 * kPanelGap;
const char* const kDiscLegend =
    "Panels: the equal-area disc of sampled directions  x: right  y: up  edge: horizon  red ellipses: one standard "
    "deviation of the Gaussians  scales: density over the area of the disc, logarithmic";
const char* const kRatioLegend =
    "  ring: worst f/p  graded density: 0.1 BSDF + 0.9 fit  ratio: red is sampled too rarely, blue too often";

int leftOf(int column) {
  return kPanelGap + column * (kPanel + kPanelGap);
}

std::string viewText(const PlotView& view) {
  if (view.half >= 1) return "whole disc";
  const Vec2 c = (view.centre * 1000).array().round() / 1000 + 0.0f;  // adding zero turns -0 into 0
  return fmt::format("centre of the view {:.3f}, {:.3f}, half width {:.3f}", c.x(), c.y(), view.half);
}

std::string rowText(const LobeCache& cache, int index, const PlotView& view) {
  const CacheRecord& r = cache.records()[static_cast<std::size_t>(index)];
  const Angles angles = anglesOf(directionOf(cache, static_cast<std::size_t>(index)));
  return fmt::format(
      "Record {}: elevation {:.1f} deg, azimuth {:.1f} deg  Gaussians {}  NEV {:.3g}  coverage {:.3g}  worst f/p "
      "{:.3g}  {}",
      index, angles.elevation, angles.azimuth, r.count, r.nev, r.nevCoverage, r.worstRatio, viewText(view));
}

/// The records of a plot, and the layout of its image from top to bottom: title, titles of the columns, and for each
/// row its text, panels and scales; then the legend.
class PlotLayout {
 public:
  PlotLayout(const LobeCache& cache, std::span<const int> records, const Lobe* lobe)
      : columns_(lobe ? 3 : 1), title_(spelledOut(cache.info().summary)), legend_(kDiscLegend) {
    if (lobe) legend_ += kRatioLegend;
    titles_ = kPanelGap + countLines(width(), title_) * kLine + kPanelGap;
    int top = titles_ + kLine + kPanelGap;
    for (const int record : records) {
      subjects_.emplace_back(cache, record, lobe);
      texts_.push_back(rowText(cache, record, subjects_.back().view()));
      tops_.push_back(top + countLines(width(), texts_.back()) * kLine + kAbove);
      top = tops_.back() + kPanel + kBelow;
    }
    end_ = top;
  }

  Raster paper() const {
    Raster raster(width(), end_ + countLines(width(), legend_) * kLine + kPanelGap, kPaper);
    drawLines(raster, kPanelGap, title_);
    const std::array<const char*, 3> titles{"Target", "Fit", "Target / graded density"};
    for (int i = 0; i < columns_; ++i) drawText(raster, leftOf(i), titles_, titles[columns_ == 1 ? 1 : i], kInk);
    for (std::size_t i = 0; i < texts_.size(); ++i)
      drawLines(raster, tops_[i] - kAbove - countLines(width(), texts_[i]) * kLine, texts_[i]);
    drawLines(raster, end_, legend_);
    return raster;
  }

  int width() const { return leftOf(columns_); }
  int top(std::size_t row) const { return tops_[row]; }
  const PlottedRecord& subject(std::size_t row) const { return subjects_[row]; }

 private:
  int columns_, titles_ = 0, end_ = 0;
  std::string title_, legend_;
  std::vector<PlottedRecord> subjects_;
  std::vector<std::string> texts_;
  std::vector<int> tops_;
};

void drawRatio(Raster& raster, const Panel& panel, const PlottedRecord& subject) {
  drawField(raster, panel, [&](const Vec2& y) {
    const double ratio = subject.ratio(y);
    return divergingColour(ratio > 0 ? std::log10(ratio) / std::log10(kPlotRatio) : -1);
  });
  const std::string limit = fmt::format("{:g}", kPlotRatio);
  drawScale(raster, panel.left, panel.top + kPanel + kPanelGap / 2, [](double t) { return divergingColour(2 * t - 1); },
            {"1/" + limit, "1", limit});
}

PlotRow drawRow(Raster& raster, int top, int index, const PlottedRecord& subject) {
  const PlotView view = subject.view();
  const auto panel = [&](int column) { return Panel{leftOf(column), top, view}; };
  const DiscFunction target = [&](const Vec2& y) { return subject.target(y); };
  const DiscFunction fit = [&](const Vec2& y) { return subject.fit(y); };
  PlotRow row{index, top, view, largest(panel(0), fit), subject.grade()};
  if (subject.hasTarget()) row.peak = std::max(row.peak, largest(panel(0), target));
  const auto density = [&](int column, const DiscFunction& of) {
    drawDensity(raster, panel(column), of, row.peak, kPlotDecades);
    drawScale(raster, leftOf(column), top + kPanel + kPanelGap / 2, sequentialColour,
              scaleLabels(row.peak, kPlotDecades));
  };
  const int fitColumn = subject.hasTarget() ? 1 : 0;
  if (subject.hasTarget()) {
    density(0, target);
    drawRatio(raster, panel(2), subject);
  }
  density(fitColumn, fit);
  drawEllipses(raster, panel(fitColumn), subject.mixture());
  if (row.grade && row.grade->worst > 0)
    for (int column = 0; column < 3; ++column) drawRing(raster, panel(column), toDisc(row.grade->worstAt));
  return row;
}

}  // namespace

Plot plotRecords(const LobeCache& cache, std::span<const int> records, const Lobe* lobe) {
  const PlotLayout layout(cache, records, lobe);
  Plot plot{layout.paper(), {}};
  for (std::size_t i = 0; i < records.size(); ++i)
    plot.rows.push_back(drawRow(plot.raster, layout.top(i), records[i], layout.subject(i)));
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
