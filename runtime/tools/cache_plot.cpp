#include "runtime/tools/cache_plot.h"

#include <algorithm>
#include <cmath>

#include "runtime/tools/plotted_record.h"

namespace lobe {
namespace {

PlotRow drawRow(Raster& raster, int top, int index, const PlottedRecord& subject) {
  const PlotView view = subject.view();
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
        drawRow(plot.raster, kPanelGap + i * (kPanel + kPanelGap), record, PlottedRecord(cache, record, lobe)));
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
