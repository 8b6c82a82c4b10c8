#include "scenes/meshes/polygon.h"

#include <algorithm>
#include <numeric>

#include <Eigen/Geometry>

namespace lobe {
namespace {

using Corners = std::vector<Eigen::Vector3d>;
using Triangle = std::array<std::size_t, 3>;

double orientation(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                   const Eigen::Vector3d& normal) {
  return (b - a).cross(c - a).dot(normal);
}

Eigen::Vector3d areaVector(const Corners& corners) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 2; i < corners.size(); ++i) sum += (corners[i - 1] - corners[0]).cross(corners[i] - corners[0]);
  return sum;
}

/// The remaining corners as a ring. Clipping an ear affects only whether its two neighbours are ears (Eberly,
/// "Triangulation by Ear Clipping"), so there are O(n) tests, each of which visits the ring once.
class EarClipper {
 public:
  explicit EarClipper(const Corners& corners)
      : corners_(corners),
        normal_(areaVector(corners)),
        next_(corners.size()),
        previous_(corners.size()),
        isEar_(corners.size()),
        left_(corners.size()) {
    std::iota(next_.begin(), next_.end(), std::size_t{1});
    next_.back() = 0;
    for (std::size_t i = 0; i < left_; ++i) previous_[next_[i]] = i;
    for (std::size_t i = 1; i < left_; ++i) isEar_[i] = testEar(i);
  }

  std::vector<Triangle> run() {
    while (left_ > 3) clip(findEar());
    triangles_.push_back(triangleAt(next_[0]));
    return std::move(triangles_);
  }

 private:
  Triangle triangleAt(std::size_t i) const { return {previous_[i], i, next_[i]}; }

  /// Whether the corner is an ear: its triangle has the orientation of the polygon, and no other corner lies inside it
  /// or on its edge, where the outline may turn inwards. A straight corner is an ear, because its triangle has no area.
  bool testEar(std::size_t i) const {
    const auto [before, at, after] = triangleAt(i);
    const Eigen::Vector3d &a = corners_[before], &b = corners_[at], &c = corners_[after];
    const double area = orientation(a, b, c, normal_);
    if (area <= 0) return area == 0;
    for (std::size_t k = next_[after]; k != before; k = next_[k]) {
      const Eigen::Vector3d& p = corners_[k];
      if (p == a || p == b || p == c) continue;
      if (orientation(a, b, p, normal_) >= 0 && orientation(b, c, p, normal_) >= 0 &&
          orientation(c, a, p, normal_) >= 0)
        return false;
    }
    return true;
  }

  /// The first ear, starting at the second corner; the second corner itself if there is none, as in self-intersecting
  /// polygons. The first corner is never clipped, so that a convex polygon becomes a fan about it.
  std::size_t findEar() const {
    for (std::size_t i = next_[0]; i != 0; i = next_[i])
      if (isEar_[i]) return i;
    return next_[0];
  }

  void clip(std::size_t ear) {
    const auto [before, at, after] = triangles_.emplace_back(triangleAt(ear));
    next_[before] = after;
    previous_[after] = before;
    --left_;
    for (const std::size_t neighbour : {before, after})
      if (neighbour != 0) isEar_[neighbour] = testEar(neighbour);
  }

  const Corners& corners_;
  Eigen::Vector3d normal_;
  std::vector<std::size_t> next_, previous_;
  std::vector<char> isEar_;
  std::size_t left_;
  std::vector<Triangle> triangles_;
};

}  // namespace

std::vector<Triangle> triangulate(const Corners& corners) {
  return EarClipper(corners).run();
}

void appendPolygon(TriangleMesh& mesh, std::span<const std::uint32_t> corners) {
  if (corners.size() == 3) {
    mesh.triangles.push_back({corners[0], corners[1], corners[2]});
    return;
  }
  Corners positions;
  positions.reserve(corners.size());
  for (const std::uint32_t i : corners) positions.push_back(mesh.positions[i].cast<double>());
  for (const auto& [i, j, k] : triangulate(positions)) mesh.triangles.push_back({corners[i], corners[j], corners[k]});
}

}  // namespace lobe
