#pragma once
// Densities over the disc of directions as square panels of a picture: fields in colour, ellipses of Gaussians, rings.
// x is to the right and y up; the disc's edge is the horizon.

#include <functional>
#include <span>

#include "runtime/analysis/raster.h"
#include "runtime/mixture/gaussian.h"

namespace lobe {

inline constexpr int kPanel = 240, kPanelGap = 8;  ///< pixels
inline constexpr Colour kPaper{1, 1, 1}, kInk{0, 0, 0};

/// A square part of the plane of the disc.
struct PlotView {
  Vec2 centre{0, 0};
  float half = 1;  ///< half of its side
};
/// All of the disc, with a little air.
inline constexpr float kWholeDisc = 1.02f;

/// Pixels of a panel and the points of the disc's plane they stand for.
struct Panel {
  int left, top;
  PlotView view;

  float step() const { return 2 * view.half / kPanel; }
  /// Of the middle of a pixel, counted from the panel's corner.
  Vec2 point(int x, int y) const;
};

/// A value for each point of the disc.
using DiscFunction = std::function<double(const Vec2&)>;

void forEachPixel(const std::function<void(int, int)>& visit);

/// Over the pixels of the panel inside the disc; 0 where there are none.
double largest(const Panel& panel, const DiscFunction& density);

void drawField(Raster& raster, const Panel& panel, const std::function<Colour(const Vec2&)>& colourOf);

/// In sequential colours on a logarithmic scale that ends at the peak and begins `decades` below it.
void drawDensity(Raster& raster, const Panel& panel, const DiscFunction& density, double peak, double decades);

/// One standard deviation about each mean, the heavier the clearer.
void drawEllipses(Raster& raster, const Panel& panel, std::span<const Gaussian> mixture);

/// Marks a point; at the panel's border when the point is out of view.
void drawRing(Raster& raster, const Panel& panel, const Vec2& where);

}  // namespace lobe
