#include "scenes/meshes/world_mesh.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <span>
#include <stdexcept>
#include <tuple>

#include <fmt/format.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "scenes/scene_scale.h"

namespace lobe {
namespace {

using Triangle = std::array<std::uint32_t, 3>;

/// Normalises in double precision, because squares of small or large floats exceed their range; zero stays zero.
Vec3 unit(const Eigen::Vector3d& v) {
  const double length = v.norm();
  return length > 0 ? Vec3((v / length).cast<float>()) : Vec3::Zero();
}

void requireFinite(const TriangleMesh& mesh) {
  for (const Vec3& p : mesh.positions)
    if (!p.allFinite()) throw std::runtime_error("a vertex position is not a finite number");
  for (const Vec3& n : mesh.normals)
    if (!n.allFinite()) throw std::runtime_error("a vertex normal is not a finite number");
  for (const Vec2& uv : mesh.uvs)
    if (!uv.allFinite()) throw std::runtime_error("a texture coordinate is not a finite number");
}

void requireInRange(const TriangleMesh& mesh) {
  for (const Vec3& p : mesh.positions)
    if (!isInRange(p))
      throw std::runtime_error(
          fmt::format("a vertex at {:g}, {:g}, {:g} in the world: coordinates over {:g} are not supported", p.x(),
                      p.y(), p.z(), kLargestCoordinate));
}

Eigen::Vector3d crossOfEdges(const TriangleMesh& mesh, const Triangle& t) {
  const Eigen::Vector3d p = mesh.positions[t[0]].cast<double>();
  return (mesh.positions[t[1]].cast<double>() - p).cross(mesh.positions[t[2]].cast<double>() - p);
}

/// The angle of the triangle at its corner-th vertex.
double angleAt(const TriangleMesh& mesh, const Triangle& t, int corner) {
  const Eigen::Vector3d p = mesh.positions[t[corner]].cast<double>();
  const Eigen::Vector3d a = mesh.positions[t[(corner + 1) % 3]].cast<double>() - p;
  const Eigen::Vector3d b = mesh.positions[t[(corner + 2) % 3]].cast<double>() - p;
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

/// Unit normals of the triangles; zero for those without area.
std::vector<Eigen::Vector3d> faceNormals(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3d> normals;
  normals.reserve(mesh.triangles.size());
  for (const Triangle& t : mesh.triangles) {
    const Eigen::Vector3d normal = crossOfEdges(mesh, t).normalized();
    normals.push_back(normal.allFinite() ? normal : Eigen::Vector3d::Zero());
  }
  return normals;
}

std::vector<Vec3> smoothNormals(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3d> sums(mesh.positions.size(), Eigen::Vector3d::Zero());
  const std::vector<Eigen::Vector3d> ofFaces = faceNormals(mesh);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
    for (int corner = 0; corner < 3; ++corner)
      sums[mesh.triangles[i][corner]] += angleAt(mesh, mesh.triangles[i], corner) * ofFaces[i];
  std::vector<Vec3> normals;
  normals.reserve(sums.size());
  for (const Eigen::Vector3d& sum : sums) normals.push_back(unit(sum));
  return normals;
}

/// Splits vertices between triangles whose normals differ by the angle or more. As in Mitsuba 0.6, vertices with equal
/// positions and texture coordinates are treated as one, whatever their indices, and the triangles around a vertex are
/// grouped greedily: the first remaining one takes all whose normals are close to its own. Throws std::runtime_error
/// that names the limit if that takes too many comparisons.
class SmoothingSplitter {
 public:
  SmoothingSplitter(const TriangleMesh& mesh, float degrees)
      : mesh_(mesh), normals_(faceNormals(mesh)), threshold_(std::cos(degrees * std::numbers::pi / 180.0)) {}

  TriangleMesh run() {
    result_.triangles.resize(mesh_.triangles.size());
    std::vector<std::size_t> corners(3 * mesh_.triangles.size());
    std::iota(corners.begin(), corners.end(), std::size_t{0});
    std::ranges::sort(corners, [this](std::size_t a, std::size_t b) {
      const auto keyA = keyOf(a), keyB = keyOf(b);
      return keyA != keyB ? keyA < keyB : a < b;
    });
    for (std::size_t begin = 0, end = 0; begin < corners.size(); begin = end) {
      while (end < corners.size() && keyOf(corners[end]) == keyOf(corners[begin])) ++end;
      splitVertex({corners.begin() + static_cast<std::ptrdiff_t>(begin), end - begin});
    }
    return std::move(result_);
  }

 private:
  std::uint32_t vertexOf(std::size_t corner) const { return mesh_.triangles[corner / 3][corner % 3]; }

  std::tuple<float, float, float, float, float> keyOf(std::size_t corner) const {
    const std::uint32_t vertex = vertexOf(corner);
    const Vec3& p = mesh_.positions[vertex];
    const Vec2 uv = mesh_.uvs.empty() ? Vec2(0, 0) : mesh_.uvs[vertex];
    return {p.x(), p.y(), p.z(), uv.x(), uv.y()};
  }

  bool areSmooth(std::size_t a, std::size_t b) const {
    const Eigen::Vector3d &n = normals_[a / 3], &m = normals_[b / 3];
    return n == m || n.dot(m) > threshold_;
  }

  /// corners: those of equal vertices. The remaining corners keep their order.
  void splitVertex(std::span<std::size_t> corners) {
    while (!corners.empty()) {
      countComparisons(corners.size());
      const std::size_t first = corners.front();
      const auto vertex = addVertex(vertexOf(first));
      const auto rest = std::stable_partition(corners.begin(), corners.end(),
                                              [&](std::size_t corner) { return areSmooth(first, corner); });
      std::for_each(corners.begin(), rest,
                    [&](std::size_t corner) { result_.triangles[corner / 3][corner % 3] = vertex; });
      corners = {rest, corners.end()};
    }
  }

  /// The limit makes the time linear. A regular mesh takes up to four for each corner, a cone with a thousand sides
  /// 170.
  void countComparisons(std::size_t count) {
    constexpr std::size_t kHarmless = 1'000'000'000, kMostPerCorner = 1000;  // the first take a second or two
    const std::size_t corners = 3 * mesh_.triangles.size();
    comparisons_ += count;
    if (comparisons_ > std::max(kHarmless, kMostPerCorner * corners))
      throw std::runtime_error(
          fmt::format("the triangles around its vertices have so many normals that maxSmoothAngle takes more than {} "
                      "comparisons for each of its {} corners",
                      kMostPerCorner, corners));
  }

  std::uint32_t addVertex(std::uint32_t from) {
    result_.positions.push_back(mesh_.positions[from]);
    if (!mesh_.uvs.empty()) result_.uvs.push_back(mesh_.uvs[from]);
    return static_cast<std::uint32_t>(result_.positions.size() - 1);
  }

  const TriangleMesh& mesh_;
  std::vector<Eigen::Vector3d> normals_;
  double threshold_;
  std::size_t comparisons_ = 0;
  TriangleMesh result_;
};

/// Winds every triangle so that its front is on the side of its vertex normals.
void windByNormals(TriangleMesh& mesh) {
  for (Triangle& t : mesh.triangles) {
    const Vec3 mean = mesh.normals[t[0]] + mesh.normals[t[1]] + mesh.normals[t[2]];
    if (crossOfEdges(mesh, t).dot(mean.cast<double>()) < 0) std::swap(t[1], t[2]);
  }
}

void transform(TriangleMesh& mesh, const Eigen::Matrix4f& toWorld) {
  const Eigen::Matrix3f linear = checkedLinear(toWorld);
  const Vec3 offset = toWorld.topRightCorner<3, 1>();
  for (Vec3& p : mesh.positions) p = linear * p + offset;
  const Eigen::Matrix3d forNormals = linear.cast<double>().inverse().transpose();
  for (Vec3& n : mesh.normals) n = unit(forNormals * n.cast<double>());
}

void turnOver(TriangleMesh& mesh) {
  for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  for (Vec3& n : mesh.normals) n = -n;
}

}  // namespace

Eigen::Matrix3f checkedLinear(const Eigen::Matrix4f& toWorld) {
  if (!toWorld.allFinite()) throw std::runtime_error("its transform has numbers that are not finite");
  if (toWorld.row(3) != Eigen::RowVector4f(0, 0, 0, 1)) throw std::runtime_error("its transform is not affine");
  Eigen::Matrix3f linear = toWorld.topLeftCorner<3, 3>();
  if (linear.cast<double>().determinant() == 0) throw std::runtime_error("its transform is singular");
  return linear;
}

TriangleMesh toWorldMesh(TriangleMesh mesh, const MeshOptions& options) {
  if (mesh.triangles.empty()) throw std::runtime_error("has no triangles");
  if (options.faceNormals) mesh.normals.clear();
  requireFinite(mesh);
  transform(mesh, options.toWorld);
  requireFinite(mesh);
  requireInRange(mesh);
  if (options.maxSmoothAngle) mesh = SmoothingSplitter(mesh, *options.maxSmoothAngle).run();
  if (!mesh.normals.empty())
    windByNormals(mesh);
  else if (!options.faceNormals)
    mesh.normals = smoothNormals(mesh);
  if (options.flipNormals) turnOver(mesh);
  if (options.flipTexCoords)
    for (Vec2& uv : mesh.uvs) uv.y() = 1.0f - uv.y();
  return mesh;
}

}  // namespace lobe
