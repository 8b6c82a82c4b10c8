#pragma once
// Internal to scenes/: a k-d tree that finds whether a triangle contains a corner of its polygon.

#include <array>
#include <cstddef>
#include <vector>

#include <Eigen/Geometry>

namespace lobe {

/// Twice the area of the triangle, times the length of the normal; positive if its corners are counter-clockwise as
/// seen from the side to which the normal points.
inline double orientation(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                          const Eigen::Vector3d& normal) {
  return (b - a).cross(c - a).dot(normal);
}

class CornerTree {
 public:
  /// The corners, at least one, must be finite and must outlive the tree. The normal is that of orientation().
  CornerTree(const std::vector<Eigen::Vector3d>& corners, const Eigen::Vector3d& normal);

  void remove(std::size_t corner);

  /// Whether a corner that has not been removed lies in the triangle of three corners or on its edge, at another
  /// position than those three. Throws std::runtime_error if all calls together have taken too many steps; then the
  /// message names the limit.
  bool anyIn(const std::array<std::size_t, 3>& triangle);

 private:
  struct Node {
    Eigen::AlignedBox3d box;
    std::size_t begin, count;  // the remaining corners in order_
    std::size_t right;         // 0: a leaf; the left child follows its parent
  };
  /// The points p with slope · (p − origin) ≥ 0 are those with orientation(origin, end of the edge, p) ≥ 0. Rounding
  /// errors are below slack.
  struct Side {
    Eigen::Vector3d origin, slope;
    double slack;
  };
  struct Triangle {
    std::array<Eigen::Vector3d, 3> corners;
    std::array<Side, 3> sides;
    Eigen::AlignedBox3d box;
  };

  std::size_t build(std::size_t begin, std::size_t end);
  Side sideOf(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const;
  bool anyIn(std::size_t node, const Triangle& triangle);
  static bool isOutside(const Eigen::AlignedBox3d& box, const Triangle& triangle);
  bool contains(const Triangle& triangle, const Eigen::Vector3d& point) const;
  void countStep();

  const std::vector<Eigen::Vector3d>& corners_;
  Eigen::Vector3d normal_;
  std::vector<std::size_t> order_, position_;  // the corners in the order of the leaves, and where each of them is
  std::vector<Node> nodes_;
  std::size_t steps_ = 0;
};

}  // namespace lobe
