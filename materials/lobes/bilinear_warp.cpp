#include "materials/lobes/bilinear_warp.h"

#include <algorithm>
#include <cmath>

namespace lobe {
namespace {

struct AxisPlace {
  std::size_t index;
  double rest;  ///< in [0,1], towards the next node
};

AxisPlace placeOn(const std::vector<float>& nodes, double x) {
  if (nodes.size() < 2) return {0, 0.0};
  const auto above = std::upper_bound(nodes.begin() + 1, nodes.end() - 1, x);
  const auto index = static_cast<std::size_t>(above - nodes.begin()) - 1;
  const double low = nodes[index];
  return {index, std::clamp((x - low) / (nodes[index + 1] - low), 0.0, 1.0)};
}

/// Integral over [0,t] of the line from a at 0 to b at 1.
double lineIntegral(double a, double b, double t) {
  return t * (a + 0.5 * t * (b - a));
}

/// The t in [0,1] at which lineIntegral equals mass.
double lineInverse(double a, double b, double mass) {
  const double root = a + std::sqrt(std::max(0.0, a * a + 2.0 * mass * (b - a)));
  return root > 0.0 ? std::clamp(2.0 * mass / root, 0.0, 1.0) : 0.0;
}

/// The last of the cells 0 to cells − 1 whose cumulative integral at its start, integral(cell), does not exceed mass.
template <typename Integral>
std::size_t cellOf(std::size_t cells, double mass, Integral&& integral) {
  std::size_t low = 0;
  std::size_t high = cells;
  while (high - low > 1) {
    const std::size_t middle = (low + high) / 2;
    (integral(middle) <= mass ? low : high) = middle;
  }
  return low;
}

double lerp(double a, double b, double t) {
  return a + t * (b - a);
}

}  // namespace

TableBlend ParameterNodes::at(double first, double second) const {
  const AxisPlace a = placeOn(first_, first);
  const AxisPlace b = placeOn(second_, second);
  const std::size_t nextRow = a.rest > 0.0 ? second_.size() : 0;
  const std::size_t next = b.rest > 0.0 ? 1 : 0;
  const std::size_t corner = a.index * second_.size() + b.index;
  return {{corner, corner + next, corner + nextRow, corner + nextRow + next},
          {(1.0 - a.rest) * (1.0 - b.rest), (1.0 - a.rest) * b.rest, a.rest * (1.0 - b.rest), a.rest * b.rest}};
}

TableCell::TableCell(const TableSize& size, const Eigen::Vector2d& point) {
  const Eigen::Array2d cells(static_cast<double>(size.width - 1), static_cast<double>(size.height - 1));
  const Eigen::Array2d place = (point.array() * cells).max(0.0).min(cells);
  const Eigen::Array2d corner = place.floor().min(cells - 1.0);
  x = static_cast<std::size_t>(corner.x());
  y = static_cast<std::size_t>(corner.y());
  rest = place - corner;
}

BilinearWarp::BilinearWarp(const TableSize& size, std::vector<float> values)
    : size_(size),
      values_(std::move(values)),
      rows_(values_.size()),
      marginals_(values_.size() / size.nodes() * size.height) {
  for (std::size_t table = 0; table < values_.size() / size.nodes(); ++table)
    integrate(std::span(values_).subspan(table * size.nodes(), size.nodes()), table);
}

void BilinearWarp::integrate(std::span<float> values, std::size_t table) {
  const double stepX = 1.0 / static_cast<double>(size_.width - 1);
  const double stepY = 1.0 / static_cast<double>(size_.height - 1);
  std::vector<double> row(values.size());
  std::vector<double> marginal(size_.height);
  const auto sumUp = [&] {
    for (std::size_t y = 0; y < size_.height; ++y) {
      double* const sums = row.data() + y * size_.width;
      const float* const nodes = values.data() + y * size_.width;
      for (std::size_t x = 1; x < size_.width; ++x)
        sums[x] = sums[x - 1] + 0.5 * stepX * (static_cast<double>(nodes[x - 1]) + nodes[x]);
      if (y > 0) marginal[y] = marginal[y - 1] + 0.5 * stepY * (sums[size_.width - 1] + sums[-1]);
    }
  };
  sumUp();
  if (!(marginal.back() > 0.0)) {
    std::ranges::fill(values, 1.0f);
    sumUp();
  }
  const double scale = 1.0 / marginal.back();
  const auto scaled = [scale](double x) { return static_cast<float>(x * scale); };
  std::ranges::transform(values, values.begin(), scaled);
  std::ranges::transform(row, rows_.begin() + static_cast<std::ptrdiff_t>(table * size_.nodes()), scaled);
  std::ranges::transform(marginal, marginals_.begin() + static_cast<std::ptrdiff_t>(table * size_.height), scaled);
}

double BilinearWarp::value(std::size_t x, std::size_t y, const TableBlend& blend) const {
  return blend(
      [&](std::size_t table) { return static_cast<double>(values_[(table * size_.height + y) * size_.width + x]); });
}

double BilinearWarp::rowIntegral(std::size_t x, std::size_t y, const TableBlend& blend) const {
  return blend(
      [&](std::size_t table) { return static_cast<double>(rows_[(table * size_.height + y) * size_.width + x]); });
}

double BilinearWarp::marginalIntegral(std::size_t y, const TableBlend& blend) const {
  return blend([&](std::size_t table) { return static_cast<double>(marginals_[table * size_.height + y]); });
}

double BilinearWarp::density(const Eigen::Vector2d& point, const TableBlend& blend) const {
  return TableCell(size_, point).interpolate([&](std::size_t x, std::size_t y) { return value(x, y, blend); });
}

WarpPoint BilinearWarp::sample(const Eigen::Vector2d& u, const TableBlend& blend) const {
  const auto cellsX = static_cast<double>(size_.width - 1);
  const auto cellsY = static_cast<double>(size_.height - 1);
  const std::size_t last = size_.width - 1;

  const auto marginal = [&](std::size_t i) { return marginalIntegral(i, blend); };
  const std::size_t y = cellOf(size_.height - 1, u.y(), marginal);
  const double low = rowIntegral(last, y, blend);
  const double high = rowIntegral(last, y + 1, blend);
  const double restY = lineInverse(low, high, (u.y() - marginal(y)) * cellsY);

  const double target = u.x() * lerp(low, high, restY);
  const auto row = [&](std::size_t i) { return lerp(rowIntegral(i, y, blend), rowIntegral(i, y + 1, blend), restY); };
  const std::size_t x = cellOf(last, target, row);
  const double left = lerp(value(x, y, blend), value(x, y + 1, blend), restY);
  const double right = lerp(value(x + 1, y, blend), value(x + 1, y + 1, blend), restY);
  const double restX = lineInverse(left, right, (target - row(x)) * cellsX);

  return {{(static_cast<double>(x) + restX) / cellsX, (static_cast<double>(y) + restY) / cellsY},
          lerp(left, right, restX)};
}

WarpPoint BilinearWarp::invert(const Eigen::Vector2d& point, const TableBlend& blend) const {
  const TableCell cell(size_, point);
  const std::size_t x = cell.x, y = cell.y, last = size_.width - 1;
  const double left = lerp(value(x, y, blend), value(x, y + 1, blend), cell.rest.y());
  const double right = lerp(value(x + 1, y, blend), value(x + 1, y + 1, blend), cell.rest.y());
  const double before = lerp(rowIntegral(x, y, blend), rowIntegral(x, y + 1, blend), cell.rest.y());
  const double low = rowIntegral(last, y, blend);
  const double high = rowIntegral(last, y + 1, blend);
  const double whole = lerp(low, high, cell.rest.y());
  const double mass = before + lineIntegral(left, right, cell.rest.x()) / static_cast<double>(last);
  const double massY =
      marginalIntegral(y, blend) + lineIntegral(low, high, cell.rest.y()) / static_cast<double>(size_.height - 1);
  return {{whole > 0.0 ? std::min(mass / whole, 1.0) : 0.0, std::min(massY, 1.0)}, lerp(left, right, cell.rest.x())};
}

}  // namespace lobe
