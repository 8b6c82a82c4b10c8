#include "runtime/analysis/disc_panel.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Dense>

namespace lobe {
namespace {

constexpr int kRing = 6;  // pixels
constexpr Colour kBeyond{0.85f, 0.85f, 0.85f}, kEllipse{1, 0.25f, 0.2f};

/// Fraction of a pixel that is covered by a line of the given width at `distance` from its centre, both in pixels.
double coverage(double distance, double width) {
  return std::clamp(0.5 * width + 0.5 - std::abs(distance), 0.0, 1.0);
}

/// The point in pixels from the panel's corner; points out of view are moved inside the border, so that the ring is
/// drawn whole.
Vec2 pixelInView(const Panel& panel, const Vec2& y) {
  const Vec2 d = (y - panel.view.centre) / panel.step();
  const float middle = 0.5f * kPanel, limit = d.cwiseAbs().maxCoeff() > middle ? middle - kRing - 3 : middle;
  return {middle + std::clamp(d.x(), -limit, limit), middle - std::clamp(d.y(), -limit, limit)};
}

std::vector<std::string> linesOf(int width, std::string_view text) {
  return wrapped(text, static_cast<std::size_t>((width - 2 * kPanelGap) / kTextAdvance));
}

/// The distance from the ellipse is approximated to first order: Mahalanobis distance over the length of its gradient.
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

}  // namespace

Vec2 Panel::point(int x, int y) const {
  const Vec2 fromCorner(static_cast<float>(x) + 0.5f, -static_cast<float>(y) - 0.5f);
  return view.centre + Vec2(-view.half, view.half) + step() * fromCorner;
}

void forEachPixel(const std::function<void(int, int)>& visit) {
  for (int y = 0; y < kPanel; ++y)
    for (int x = 0; x < kPanel; ++x) visit(x, y);
}

double largest(const Panel& panel, const DiscFunction& density) {
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

void drawDensity(Raster& raster, const Panel& panel, const DiscFunction& density, double peak, double decades) {
  drawField(raster, panel, [&](const Vec2& y) {
    const double value = density(y);
    return sequentialColour(value > 0 && peak > 0 ? 1 + std::log10(value / peak) / decades : 0);
  });
}

void drawEllipses(Raster& raster, const Panel& panel, std::span<const Gaussian> mixture) {
  if (mixture.empty()) return;
  const float heaviest = std::ranges::max(mixture, {}, &Gaussian::weight).weight;
  for (const Gaussian& g : mixture) drawEllipse(raster, panel, g, 0.3 + 0.7 * std::sqrt(g.weight / heaviest));
}

void drawScale(Raster& raster, int left, int top, const std::function<Colour(double)>& colourOf,
               const std::array<std::string, 3>& labels) {
  constexpr int kBar = 8;
  for (int x = 0; x < kPanel; ++x)
    for (int y = 0; y < kBar; ++y) raster.set(left + x, top + y, colourOf((x + 0.5) / kPanel));
  for (int i = 0; i < 3; ++i) {
    const int width = kTextAdvance * static_cast<int>(labels[i].size());
    drawText(raster, left + i * (kPanel - width) / 2, top + kBar + 4, labels[i], kInk);
  }
}

std::array<std::string, 3> scaleLabels(double peak, double decades) {
  const auto label = [&](double below) { return fmt::format("{:.4g}", peak * std::pow(10, -below)); };
  return {label(decades), label(decades / 2), label(0)};
}

int drawLines(Raster& raster, int top, std::string_view text) {
  for (const std::string& line : linesOf(raster.width(), text)) {
    drawText(raster, kPanelGap, top, line, kInk);
    top += kLine;
  }
  return top;
}

int countLines(int width, std::string_view text) {
  return static_cast<int>(linesOf(width, text).size());
}

void drawRing(Raster& raster, const Panel& panel, const Vec2& where) {
  const Vec2 centre = pixelInView(panel, where);
  forEachPixel([&](int x, int y) {
    const double r = (Vec2(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f) - centre).norm();
    raster.blend(panel.left + x, panel.top + y, kPaper, coverage(r - kRing, 5));
    raster.blend(panel.left + x, panel.top + y, kInk, coverage(r - kRing, 2));
  });
}

}  // namespace lobe
