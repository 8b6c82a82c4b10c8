#pragma once
// Plots of the records of a BRDF cache over the disc of wi, one row of panels (target, fit, ratio) for each record.
//
// Target: ρ cosθ / albedo. Fit: G cosθ / ∫ G cosθ dA. Both are densities over the disc, on one logarithmic scale that
// ends kPlotDecades below the larger of their peaks. Ratio: target over the graded density (0.1 BSDF + 0.9 fit), on a
// diverging scale from 1/kPlotRatio (blue: sampled too often) over 1 (white) to kPlotRatio (red: sampled too rarely).
// x points right and y up; the edge of the disc is the horizon.

#include <optional>
#include <span>
#include <vector>

#include "fitter/lobe_fit.h"
#include "materials/lobe.h"
#include "runtime/analysis/disc_panel.h"
#include "schema/lobe_cache.h"

namespace lobe {

inline constexpr double kPlotDecades = 3;
inline constexpr double kPlotRatio = 10;

struct PlotRow {
  int record;
  int top;                       ///< of its panels, in pixels
  PlotView view;                 ///< the whole disc, or an enlarged view of a small lobe
  double peak;                   ///< upper end of the scale of target and fit
  std::optional<Quality> grade;  ///< only if the lobe is available
};

struct Plot {
  Raster raster;
  std::vector<PlotRow> rows;  ///< from top to bottom
};

/// Draws target, fit and ratio of the records, or only the fit if lobe is null. All records must have components, and
/// lobe must be the one that the cache was fitted to. The fit shows the one-standard-deviation ellipses of all
/// components. Titles, the direction and the grades of each record, colour scales and a legend are around the panels. A
/// ring marks the point of the worst f/p in all panels, at their border if the point is out of view.
Plot plotRecords(const LobeCache& cache, std::span<const int> records, const Lobe* lobe);

/// Indices of up to `rows` of `count` records, evenly spaced from the first to the last.
std::vector<int> spreadRecords(int count, int rows);

}  // namespace lobe
