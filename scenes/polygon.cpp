#include "scenes/polygon.h"

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

/// Whether the triangle can be cut off: it is not turned against the polygon, and no other corner lies in it.
bool isEar(const Corners& corners, const std::vector<std::size_t>& rest, const Triangle& t,
           const Eigen::Vector3d& normal) {
  const Eigen::Vector3d &a = corners[t[0]], &b = corners[t[1]], &c = corners[t[2]];
  if (orientation(a, b, c, normal) < 0) return false;
  return std::ranges::none_of(rest, [&](std::size_t i) {
    const Eigen::Vector3d& p = corners[i];
    return orientation(a, b, p, normal) > 0 && orientation(b, c, p, normal) > 0 && orientation(c, a, p, normal) > 0;
  });
}

Eigen::Vector3d areaVector(const Corners& corners) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 2; i < corners.size(); ++i) sum += (corners[i - 1] - corners[0]).cross(corners[i] - corners[0]);
  return sum;
}

}  // namespace

std::vector<std::array<std::size_t, 3>> triangulate(const std::vector<Eigen::Vector3d>& corners) {
  const Eigen::Vector3d normal = areaVector(corners);
  std::vector<std::size_t> rest(corners.size());
  std::iota(rest.begin(), rest.end(), std::size_t{0});
  std::vector<Triangle> triangles;
  const auto triangleAt = [&rest](std::size_t i) {
    return Triangle{rest[i - 1], rest[i], rest[(i + 1) % rest.size()]};
  };
  while (rest.size() > 3) {
    std::size_t ear = 1;
    while (ear < rest.size() && !isEar(corners, rest, triangleAt(ear), normal)) ++ear;
    if (ear == rest.size()) ear = 1;
    triangles.push_back(triangleAt(ear));
    rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(ear));
  }
  triangles.push_back({rest[0], rest[1], rest[2]});
  return triangles;
}

}  // namespace lobe
