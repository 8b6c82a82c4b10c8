#include "scenes/obj.h"

#include <algorithm>

#include "scenes/mesh_file.h"
#include "scenes/obj_text.h"
#include "scenes/polygon.h"
#include "scenes/world_mesh.h"

namespace lobe {
namespace {

constexpr int kNone = ObjData::kNone;
using Corner = ObjData::Corner;

/// Drops what not all corners have (normals), or none (texture coordinates; the others get the origin).
void dropUnused(ObjData& data, bool faceNormals) {
  const bool allNormals = std::ranges::none_of(data.corners, [](const Corner& c) { return c.normal == kNone; });
  const bool anyUvs = std::ranges::any_of(data.corners, [](const Corner& c) { return c.uv != kNone; });
  if (faceNormals || !allNormals) data.normals.clear();
  if (!anyUvs) data.uvs.clear();
  if (data.normals.empty())
    for (Corner& corner : data.corners) corner.normal = kNone;
}

// ---- From corners to vertices

/// Gives each distinct corner one vertex. Corners of one position are few, so they are searched one by one.
class VertexTable {
 public:
  explicit VertexTable(std::size_t positions) : first_(positions, kNone) {}

  std::uint32_t vertexOf(const Corner& corner) {
    int* link = &first_[corner.position];
    while (*link != kNone) {
      Entry& entry = entries_[*link];
      if (entry.corner.uv == corner.uv && entry.corner.normal == corner.normal) return *link;
      link = &entry.next;
    }
    *link = static_cast<int>(entries_.size());
    entries_.push_back({corner, kNone});  // link may dangle from here on
    return static_cast<std::uint32_t>(entries_.size() - 1);
  }

  std::size_t size() const { return entries_.size(); }
  const Corner& corner(std::size_t vertex) const { return entries_[vertex].corner; }

 private:
  struct Entry {
    Corner corner;
    int next;
  };
  std::vector<int> first_;
  std::vector<Entry> entries_;
};

void addFace(const ObjData& data, std::size_t begin, std::size_t end, VertexTable& vertices, TriangleMesh& mesh) {
  std::vector<std::uint32_t> ids;
  for (std::size_t i = begin; i < end; ++i) ids.push_back(vertices.vertexOf(data.corners[i]));
  if (ids.size() == 3) {
    mesh.triangles.push_back({ids[0], ids[1], ids[2]});
    return;
  }
  std::vector<Eigen::Vector3d> polygon;
  for (std::size_t i = begin; i < end; ++i) polygon.push_back(data.positions[data.corners[i].position].cast<double>());
  for (const auto& [i, j, k] : triangulate(polygon)) mesh.triangles.push_back({ids[i], ids[j], ids[k]});
}

TriangleMesh buildMesh(const ObjData& data, int part) {
  TriangleMesh mesh;
  mesh.triangles.reserve(data.corners.size() / 3);
  VertexTable vertices(data.positions.size());
  for (std::size_t face = 0; face + 1 < data.faceEnds.size(); ++face)
    if (data.faceParts[face] == part) addFace(data, data.faceEnds[face], data.faceEnds[face + 1], vertices, mesh);
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const Corner& corner = vertices.corner(i);
    mesh.positions.push_back(data.positions[corner.position]);
    if (!data.normals.empty()) mesh.normals.push_back(data.normals[corner.normal]);
    if (!data.uvs.empty()) mesh.uvs.push_back(corner.uv == kNone ? Vec2(0, 0) : data.uvs[corner.uv]);
  }
  return mesh;
}

}  // namespace

TriangleMesh readObj(const std::filesystem::path& path, const MeshOptions& options) {
  return readObjByMaterial(path, options, {}).front();
}

std::vector<TriangleMesh> readObjByMaterial(const std::filesystem::path& path, const MeshOptions& options,
                                            const std::vector<std::string>& materials) {
  return naming(path, [&] {
    ObjData data = parseObj(readBytes(path), materials);
    dropUnused(data, options.faceNormals);
    std::vector<TriangleMesh> meshes;
    for (std::size_t part = 0; part <= materials.size(); ++part) {
      TriangleMesh mesh = buildMesh(data, static_cast<int>(part));
      // With one mesh for the file, an empty one is a fault.
      if (mesh.triangles.empty() && !materials.empty())
        meshes.emplace_back();
      else
        meshes.push_back(toWorldMesh(std::move(mesh), options));
    }
    return meshes;
  });
}

}  // namespace lobe
