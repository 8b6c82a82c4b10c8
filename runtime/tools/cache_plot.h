#pragma once
// Records of a cache as pictures over the disc of wi: target, fit and ratio, a row each.
//
// Target: ρ cosθ / albedo. Fit: G cosθ / ∫ G cosθ dA. Both are densities over the disc on one logarithmic scale that
// ends kPlotDecades below the larger of their peaks. Ratio: target over the defensive density of 0.1 BSDF and 0.9 fit
// that grades are of, on a diverging scale from 1/kPlotRatio (blue: drawn too often) over 1 (white) to kPlotRatio (red:
// too seldom). x is to the right and y up; the disc's edge is the horizon.

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
  PlotView view;                 ///< the whole disc, or about the lobe where that is small
  double peak;                   ///< where the scale of target and fit ends
  std::optional<Quality> grade;  ///< only with the lobe at hand
};

struct Plot {
  Raster raster;
  std::vector<PlotRow> rows;  ///< from the top
};

/// Panels of target, fit and ratio for each of the records, which have components, or of the fit alone when lobe is
/// null. The lobe is the cache's. Over the fit lie the ellipses of one standard deviation of all components; the point
/// of the worst f/p is ringed in all panels, at their border where it is out of view.
Plot plotRecords(const LobeCache& cache, std::span<const int> records, const Lobe* lobe);

/// At most `rows` of `count` records, evenly from first to last.
std::vector<int> spreadRecords(int count, int rows);

}  // namespace lobe
