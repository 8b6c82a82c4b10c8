#include "scenes/world_mesh.h"

#include <cmath>
#include <stdexcept>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace lobe {
namespace {

using Triangle = std::array<std::uint32_t, 3>;

/// Normalised in double precision, as squares of small or large floats leave their range; zero stays zero.
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

std::vector<Vec3> smoothNormals(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3d> sums(mesh.positions.size(), Eigen::Vector3d::Zero());
  for (const Triangle& t : mesh.triangles) {
    const Eigen::Vector3d normal = crossOfEdges(mesh, t).normalized();
    if (!normal.allFinite()) continue;
    for (int corner = 0; corner < 3; ++corner) sums[t[corner]] += angleAt(mesh, t, corner) * normal;
  }
  std::vector<Vec3> normals;
  normals.reserve(sums.size());
  for (const Eigen::Vector3d& sum : sums) normals.push_back(unit(sum));
  return normals;
}

/// Winds every triangle so that its front is on its vertex normals' side.
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
  if (!toWorld.allFinite()) throw std::runtime_error("its transform holds numbers that are not finite");
  if (toWorld.row(3) != Eigen::RowVector4f(0, 0, 0, 1)) throw std::runtime_error("its transform is not affine");
  const Eigen::Matrix3f linear = toWorld.topLeftCorner<3, 3>();
  if (linear.cast<double>().determinant() == 0) throw std::runtime_error("its transform is singular");
  return linear;
}

TriangleMesh toWorldMesh(TriangleMesh mesh, const MeshOptions& options) {
  if (mesh.triangles.empty()) throw std::runtime_error("holds no triangles");
  if (options.faceNormals) mesh.normals.clear();
  requireFinite(mesh);
  transform(mesh, options.toWorld);
  requireFinite(mesh);
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
