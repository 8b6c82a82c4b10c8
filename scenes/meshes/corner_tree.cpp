#include "scenes/meshes/corner_tree.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

namespace lobe {
namespace {

constexpr std::size_t kMostInLeaf = 8;

/// Limit on the nodes visited, so that triangulation takes linear time. Usual polygons take about ten per corner, and a
/// circle with a thousand corners forty.
constexpr std::size_t kMostStepsPerCorner = 1000;

/// The point of the box that is farthest in the direction.
Eigen::Vector3d farthest(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& direction) {
  return (direction.array() > 0).select(box.max(), box.min());
}

bool isCornerOf(const std::array<Eigen::Vector3d, 3>& corners, const Eigen::Vector3d& point) {
  return point == corners[0] || point == corners[1] || point == corners[2];
}

}  // namespace

CornerTree::CornerTree(const std::vector<Eigen::Vector3d>& corners, const Eigen::Vector3d& normal)
    : corners_(corners), normal_(normal), order_(corners.size()), position_(corners.size()) {
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  build(0, order_.size());
  for (std::size_t i = 0; i < order_.size(); ++i) position_[order_[i]] = i;
}

/// Returns the index of the node.
std::size_t CornerTree::build(std::size_t begin, std::size_t end) {
  const std::size_t index = nodes_.size();
  Node node{{}, begin, end - begin, 0};
  for (std::size_t i = begin; i < end; ++i) node.box.extend(corners_[order_[i]]);
  nodes_.push_back(node);
  if (node.count <= kMostInLeaf) return index;
  Eigen::Index axis = 0;
  node.box.sizes().maxCoeff(&axis);
  const std::size_t middle = begin + node.count / 2;
  const auto at = [this](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(begin), at(middle), at(end),
                   [&](std::size_t i, std::size_t j) { return corners_[i][axis] < corners_[j][axis]; });
  build(begin, middle);
  const std::size_t right = build(middle, end);
  nodes_[index].right = right;
  return index;
}

void CornerTree::remove(std::size_t corner) {
  const std::size_t position = position_[corner];
  std::size_t node = 0;
  for (--nodes_[node].count; nodes_[node].right != 0; --nodes_[node].count) {
    const std::size_t right = nodes_[node].right;
    node = position < nodes_[right].begin ? node + 1 : right;
  }
  const std::size_t last = nodes_[node].begin + nodes_[node].count;
  std::swap(order_[position], order_[last]);
  position_[order_[position]] = position;
}

bool CornerTree::anyIn(const std::array<std::size_t, 3>& triangle) {
  const Eigen::Vector3d &a = corners_[triangle[0]], &b = corners_[triangle[1]], &c = corners_[triangle[2]];
  Eigen::AlignedBox3d box(a);
  box.extend(b).extend(c);
  return anyIn(0, {{a, b, c}, {sideOf(a, b), sideOf(b, c), sideOf(c, a)}, box});
}

CornerTree::Side CornerTree::sideOf(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const {
  constexpr double kRounding = 1e-12;
  const Eigen::Vector3d edge = to - from;
  const double size = nodes_[0].box.diagonal().norm();
  return {from, normal_.cross(edge), kRounding * edge.norm() * normal_.norm() * size};
}

bool CornerTree::anyIn(std::size_t node, const Triangle& triangle) {
  countStep();
  const auto& [box, begin, count, right] = nodes_[node];
  if (count == 0 || isOutside(box, triangle)) return false;
  if (right != 0) return anyIn(node + 1, triangle) || anyIn(right, triangle);
  return std::any_of(order_.begin() + static_cast<std::ptrdiff_t>(begin),
                     order_.begin() + static_cast<std::ptrdiff_t>(begin + count),
                     [&](std::size_t corner) { return contains(triangle, corners_[corner]); });
}

bool CornerTree::isOutside(const Eigen::AlignedBox3d& box, const Triangle& triangle) {
  if (!box.intersects(triangle.box)) return true;
  for (const Side& side : triangle.sides)
    if (side.slope.dot(farthest(box, side.slope) - side.origin) < -side.slack) return true;
  // Many corners may be at one position.
  return box.min() == box.max() && isCornerOf(triangle.corners, box.min());
}

bool CornerTree::contains(const Triangle& triangle, const Eigen::Vector3d& point) const {
  const auto& [a, b, c] = triangle.corners;
  return !isCornerOf(triangle.corners, point) && orientation(a, b, point, normal_) >= 0 &&
         orientation(b, c, point, normal_) >= 0 && orientation(c, a, point, normal_) >= 0;
}

void CornerTree::countStep() {
  if (++steps_ > kMostStepsPerCorner * corners_.size())
    throw std::runtime_error(fmt::format("a polygon with {} corners takes more than {} steps per corner to triangulate",
                                         corners_.size(), kMostStepsPerCorner));
}

}  // namespace lobe
