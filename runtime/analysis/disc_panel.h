#pragma once
// Draws densities over the disc of directions as square panels of an image: colour maps, ellipses of Gaussians, and
// rings that mark points. x points to the right and y up; the edge of the disc is the horizon.

#include <array>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "runtime/analysis/raster.h"
#include "runtime/analysis/text.h"
#include "runtime/mixture/gaussian.h"

namespace lobe {

inline constexpr int kPanel = 240, kPanelGap = 8;  ///< pixels
inline constexpr Colour kPaper{1, 1, 1}, kInk{0, 0, 0};

inline constexpr int kLine = kTextHeight + 4;    ///< pixels from a line of text to the next
inline constexpr int kScaleHeight = 12 + kLine;  ///< pixels of a colour scale with its labels

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

/// Draws a bar of colours, as wide as a panel, for t from 0 to 1, with labels at its ends and its middle.
void drawScale(Raster& raster, int left, int top, const std::function<Colour(double)>& colourOf,
               const std::array<std::string, 3>& labels);

/// The labels of a logarithmic scale from `decades` below the peak up to the peak.
std::array<std::string, 3> scaleLabels(double peak, double decades);

/// Draws the text in lines that fit between the margins of the raster, and returns the position after the last one.
int drawLines(Raster& raster, int top, std::string_view text);
/// The number of lines that drawLines needs in a raster of this width.
int countLines(int width, std::string_view text);

/// Draws a ring around a point, or at the border of the panel if the point is out of view.
void drawRing(Raster& raster, const Panel& panel, const Vec2& where);

}  // namespace lobe
