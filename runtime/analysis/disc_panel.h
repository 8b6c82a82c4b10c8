#pragma once
// Draws densities over the disc of directions as square panels of an image: colour maps, ellipses of Gaussians, and
// rings that mark points. x points to the right and y up; the edge of the disc is the horizon.

#include <functional>
#include <span>

#include "runtime/analysis/raster.h"
#include "runtime/mixture/gaussian.h"

namespace lobe {

inline constexpr int kPanel = 240, kPanelGap = 8;  ///< pixels
inline constexpr Colour kPaper{1, 1, 1}, kInk{0, 0, 0};

/// A square section of the plane of the disc.
struct PlotView {
  Vec2 centre{0, 0};
  float half = 1;  ///< half of its side length
};
/// Half side length of a view of the whole disc with a small margin.
inline constexpr float kWholeDisc = 1.02f;

/// A panel: its position in the image, in pixels, and the section of the plane that it shows.
struct Panel {
  int left, top;
  PlotView view;

  float step() const { return 2 * view.half / kPanel; }
  /// The point at the centre of a pixel; x and y count from the panel's top left corner.
  Vec2 point(int x, int y) const;
};

/// A scalar function over the disc.
using DiscFunction = std::function<double(const Vec2&)>;

void forEachPixel(const std::function<void(int, int)>& visit);

/// The largest value at the panel's pixels inside the disc; 0 if there are none.
double largest(const Panel& panel, const DiscFunction& density);

void drawField(Raster& raster, const Panel& panel, const std::function<Colour(const Vec2&)>& colourOf);

/// Draws the density in sequential colours on a logarithmic scale, from `decades` below the peak up to the peak.
void drawDensity(Raster& raster, const Panel& panel, const DiscFunction& density, double peak, double decades);

/// Draws the one-standard-deviation ellipse of each Gaussian; opacity increases with weight.
void drawEllipses(Raster& raster, const Panel& panel, std::span<const Gaussian> mixture);

/// Draws a ring around a point, or at the border of the panel if the point is out of view.
void drawRing(Raster& raster, const Panel& panel, const Vec2& where);

}  // namespace lobe
