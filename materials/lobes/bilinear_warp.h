#pragma once
// Bilinear tables over the unit square, one for each node of two parameters, between which they are interpolated
// linearly: tables of values, and densities with samplers (Dupuy and Jakob 2018, "An Adaptive Parameterization for
// Efficient Material Acquisition and Rendering", section 4 and supplement).
//
// The nodes of a table include the border of the square; x varies fastest.

#include <array>
#include <cstddef>
#include <span>
#include <type_traits>
#include <vector>

#include "runtime/core/vec.h"

namespace lobe {

/// The tables to interpolate for a pair of parameters, with weights that sum to 1; unused entries have weight 0.
struct TableBlend {
  std::array<std::size_t, 4> table{};
  std::array<double, 4> weight{};

  /// Σ weight · value(table)
  template <typename Value>
  auto operator()(Value&& value) const {
    std::decay_t<decltype(value(table[0]))> sum = value(table[0]) * weight[0];
    for (std::size_t i = 1; i < table.size(); ++i)
      if (weight[i] > 0.0) sum += value(table[i]) * weight[i];
    return sum;
  }
};

/// The nodes of both parameters, ascending. In the order of tables the second parameter varies fastest.
class ParameterNodes {
 public:
  ParameterNodes(std::vector<float> first, std::vector<float> second)
      : first_(std::move(first)), second_(std::move(second)) {}

  std::size_t tables() const { return first_.size() * second_.size(); }
  const std::vector<float>& first() const { return first_; }
  const std::vector<float>& second() const { return second_; }

  /// Parameters outside the range of the nodes are clamped.
  TableBlend at(double first, double second) const;

 private:
  std::vector<float> first_;
  std::vector<float> second_;
};

/// Width and height in nodes, at least 2 each.
struct TableSize {
  std::size_t width, height;
  std::size_t nodes() const { return width * height; }
};

/// A cell of a table and a position within it.
struct TableCell {
  TableCell(const TableSize& size, const Eigen::Vector2d& point);

  std::size_t x, y;     ///< node of the lower corner
  Eigen::Array2d rest;  ///< position within the cell, in [0,1]²

  /// Interpolates node(x, y) bilinearly.
  template <typename Node>
  auto interpolate(Node&& node) const {
    const double right = rest.x(), upper = rest.y();
    std::decay_t<decltype(node(x, y))> sum = node(x, y) * ((1.0 - right) * (1.0 - upper));
    sum += node(x + 1, y) * (right * (1.0 - upper));
    sum += node(x, y + 1) * ((1.0 - right) * upper);
    sum += node(x + 1, y + 1) * (right * upper);
    return sum;
  }
};

struct WarpPoint {
  Eigen::Vector2d point;
  double density;  ///< of the warped uniform distribution at the point, over the square
};

/// Densities over the square. Sampling inverts the marginal distribution of y, then the conditional one of x.
class BilinearWarp {
 public:
  /// Non-negative values of one or more tables, each of which is normalised. A table of zeros becomes uniform.
  BilinearWarp(const TableSize& size, std::vector<float> values);

  double density(const Eigen::Vector2d& point, const TableBlend& blend) const;

  /// Maps a uniform u in the square to a point with this density, and returns the density there.
  WarpPoint sample(const Eigen::Vector2d& u, const TableBlend& blend) const;

  /// The inverse of sample(): the u that it maps to the point, and the density at the point. Where the density is zero,
  /// u is not unique.
  WarpPoint invert(const Eigen::Vector2d& point, const TableBlend& blend) const;

 private:
  void integrate(std::span<float> values, std::size_t table);
  double value(std::size_t x, std::size_t y, const TableBlend& blend) const;
  double rowIntegral(std::size_t x, std::size_t y, const TableBlend& blend) const;
  double marginalIntegral(std::size_t y, const TableBlend& blend) const;

  TableSize size_;
  std::vector<float> values_;
  std::vector<float> rows_;       // integral along x up to each node, in values_' order
  std::vector<float> marginals_;  // integral of whole rows up to each y
};

}  // namespace lobe
