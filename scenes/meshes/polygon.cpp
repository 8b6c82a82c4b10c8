#include "scenes/meshes/polygon.h"

#include <numeric>
#include <stdexcept>

#include <Eigen/Geometry>

#include "scenes/meshes/corner_tree.h"

namespace lobe {
namespace {

using Corners = std::vector<Eigen::Vector3d>;
using Triangle = std::array<std::size_t, 3>;

Eigen::Vector3d areaVector(const Corners& corners) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 2; i < corners.size(); ++i) sum += (corners[i - 1] - corners[0]).cross(corners[i] - corners[0]);
  return sum;
}

/// The remaining corners as a ring. Clipping an ear affects only whether its two neighbours are ears (Eberly,
/// "Triangulation by Ear Clipping"), so there are O(n) tests.
class EarClipper {
 public:
  explicit EarClipper(const Corners& corners)
      : corners_(corners),
        normal_(areaVector(corners)),
        tree_(corners, normal_),
        next_(corners.size()),
        previous_(corners.size()),
        isEar_(corners.size()),
        left_(corners.size()) {
    std::iota(next_.begin(), next_.end(), std::size_t{1});
    next_.back() = 0;
    for (std::size_t i = 0; i < left_; ++i) previous_[next_[i]] = i;
    for (std::size_t i = 1; i < left_; ++i) isEar_[i] = testEar(i);
    triangles_.reserve(left_ - 2);
  }

  /// Clips the first ear again and again. The first corner is never clipped, so that a convex polygon becomes the fan
  /// about it. Where no ear is left, as in self-intersecting polygons, the second corner is clipped, and no other one
  /// can become an ear: the rest becomes a fan, too.
  std::vector<Triangle> run() {
    for (std::size_t i = next_[0]; i != 0 && left_ > 3;) {
      if (!isEar_[i]) {
        i = next_[i];
        continue;
      }
      clip(i);
      i = previous_[i] == 0 ? next_[i] : previous_[i];  // no earlier corner is an ear
    }
    for (std::size_t i = next_[0]; next_[i] != 0; i = next_[i]) triangles_.push_back({0, i, next_[i]});
    return std::move(triangles_);
  }

 private:
  Triangle triangleAt(std::size_t i) const { return {previous_[i], i, next_[i]}; }

  /// Whether the corner is an ear: its triangle has the orientation of the polygon, and no other corner lies inside it
  /// or on its edge, where the outline may turn inwards. A straight corner is an ear, because its triangle has no area.
  bool testEar(std::size_t i) {
    const Triangle triangle = triangleAt(i);
    const auto& [before, at, after] = triangle;
    const double area = orientation(corners_[before], corners_[at], corners_[after], normal_);
    return area > 0 ? !tree_.anyIn(triangle) : area == 0;
  }

  void clip(std::size_t ear) {
    const auto [before, at, after] = triangles_.emplace_back(triangleAt(ear));
    next_[before] = after;
    previous_[after] = before;
    tree_.remove(ear);
    --left_;
    for (const std::size_t neighbour : {before, after})
      if (neighbour != 0) isEar_[neighbour] = testEar(neighbour);
  }

  const Corners& corners_;
  Eigen::Vector3d normal_;
  CornerTree tree_;  // of the remaining corners
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
  for (const std::uint32_t i : corners) {
    if (!mesh.positions[i].allFinite()) throw std::runtime_error("a vertex position is not a finite number");
    positions.push_back(mesh.positions[i].cast<double>());
  }
  for (const auto& [i, j, k] : triangulate(positions)) mesh.triangles.push_back({corners[i], corners[j], corners[k]});
}

}  // namespace lobe
