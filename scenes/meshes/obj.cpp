#include "scenes/meshes/obj.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <span>
#include <string_view>
#include <unordered_map>

#include <fmt/format.h>

#include "runtime/core/files.h"
#include "scenes/meshes/obj_text.h"
#include "scenes/meshes/polygon.h"
#include "scenes/meshes/world_mesh.h"

namespace lobe {
namespace {

constexpr int kNone = ObjData::kNone;
using Corner = ObjData::Corner;
using Face = ObjData::Face;
/// Faces that share vertices with each other, but not with those of other runs.
using Run = std::vector<Face>;

// ---- From faces to parts

/// Keeps the selected faces, and sets their material and mesh according to the grouping.
void select(ObjData& data, const ObjSelection& selection) {
  const bool collapsed = selection.grouping == ObjGrouping::collapsed;
  for (Face& face : data.faces) {
    if (collapsed) face.material = data.lastMaterial;
    if (collapsed) face.mesh = 0;
  }
  if (selection.mesh < 0) return;
  const int count = data.faces.empty() ? 0 : data.faces.back().mesh + 1;
  if (selection.mesh >= count)
    throw std::runtime_error(
        fmt::format("there is no mesh {}: the file has {}, counted from 0", selection.mesh, count));
  std::erase_if(data.faces, [&](const Face& face) { return face.mesh != selection.mesh; });
}

/// For each of the data's materials, its index in `wanted`, or the size of `wanted` if it is not there.
std::vector<std::size_t> partsOfMaterials(const ObjData& data, const std::vector<std::string>& wanted) {
  std::map<std::string_view, std::size_t> indices;
  for (std::size_t i = 0; i < wanted.size(); ++i) indices.try_emplace(wanted[i], i);
  std::vector<std::size_t> parts;
  for (const std::string& name : data.materials) {
    const auto entry = indices.find(name);
    parts.push_back(entry == indices.end() ? wanted.size() : entry->second);
  }
  return parts;
}

/// For each part, its runs.
std::vector<std::vector<Run>> divide(const ObjData& data, const ObjSelection& selection) {
  const std::vector<std::size_t> partOf = partsOfMaterials(data, selection.materials);
  std::vector<std::vector<Run>> parts(selection.materials.size() + 1);
  for (const Face& face : data.faces) {
    std::vector<Run>& runs = parts[partOf[static_cast<std::size_t>(face.material)]];
    const bool separate = selection.grouping == ObjGrouping::separate;
    if (runs.empty() || (separate && runs.back().back().mesh != face.mesh)) runs.emplace_back();
    runs.back().push_back(face);
  }
  return parts;
}

// ---- From corners to vertices

struct CornerHash {
  std::size_t operator()(const Corner& corner) const {
    std::uint64_t hash = 0;
    for (const int index : {corner.position, corner.uv, corner.normal})
      hash = (hash + static_cast<std::uint32_t>(index)) * 0x9e3779b97f4a7c15;  // 2^64 divided by the golden ratio
    return hash;
  }
};

/// Creates one vertex for each distinct corner of a run.
class RunBuilder {
 public:
  explicit RunBuilder(const ObjData& data) : data_(data) {}

  TriangleMesh build(const Run& run, bool faceNormals) {
    useWhatIsThere(run, faceNormals);
    TriangleMesh mesh;
    mesh.triangles.reserve(run.size());
    vertices_.reserve(run.size());
    for (const Face& face : run) addFace(face, mesh);
    return mesh;
  }

 private:
  std::span<const Corner> cornersOf(const Face& face) const {
    return {data_.corners.begin() + static_cast<std::ptrdiff_t>(face.begin), face.end - face.begin};
  }

  /// Normals are used when all corners have one, texture coordinates when any has (the others get (0, 0)).
  void useWhatIsThere(const Run& run, bool faceNormals) {
    useNormals_ = !faceNormals;
    useUvs_ = false;
    for (const Face& face : run)
      for (const Corner& corner : cornersOf(face)) {
        useNormals_ = useNormals_ && corner.normal != kNone;
        useUvs_ = useUvs_ || corner.uv != kNone;
      }
  }

  void addFace(const Face& face, TriangleMesh& mesh) {
    ids_.clear();
    for (const Corner& corner : cornersOf(face)) ids_.push_back(vertexOf(corner, mesh));
    appendPolygon(mesh, ids_);
  }

  std::uint32_t vertexOf(Corner corner, TriangleMesh& mesh) {
    if (!useNormals_) corner.normal = kNone;
    const auto [entry, isNew] = vertices_.try_emplace(corner, static_cast<std::uint32_t>(mesh.positions.size()));
    if (!isNew) return entry->second;
    mesh.positions.push_back(data_.positions[corner.position]);
    if (useNormals_) mesh.normals.push_back(data_.normals[corner.normal]);
    if (useUvs_) mesh.uvs.push_back(corner.uv == kNone ? Vec2(0, 0) : data_.uvs[corner.uv]);
    return entry->second;
  }

  const ObjData& data_;
  std::unordered_map<Corner, std::uint32_t, CornerHash> vertices_;
  std::vector<std::uint32_t> ids_;
  bool useNormals_ = false, useUvs_ = false;
};

/// Vertices without texture coordinates get (0, 0) if others have some. All vertices have normals.
void append(TriangleMesh& mesh, const TriangleMesh& more) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  if (!more.uvs.empty() || !mesh.uvs.empty()) {
    mesh.uvs.resize(first, Vec2(0, 0));
    mesh.uvs.insert(mesh.uvs.end(), more.uvs.begin(), more.uvs.end());
    mesh.uvs.resize(first + more.positions.size(), Vec2(0, 0));
  }
  mesh.positions.insert(mesh.positions.end(), more.positions.begin(), more.positions.end());
  mesh.normals.insert(mesh.normals.end(), more.normals.begin(), more.normals.end());
  for (const auto& [i, j, k] : more.triangles) mesh.triangles.push_back({first + i, first + j, first + k});
}

TriangleMesh buildPart(const ObjData& data, const std::vector<Run>& runs, const MeshOptions& options) {
  TriangleMesh mesh;
  for (const Run& run : runs) {
    TriangleMesh more = toWorldMesh(RunBuilder(data).build(run, options.faceNormals), options);
    if (mesh.triangles.empty())
      mesh = std::move(more);
    else
      append(mesh, more);
  }
  return mesh;
}

}  // namespace

TriangleMesh readObj(const std::filesystem::path& path, const MeshOptions& options) {
  return std::move(readObjByMaterial(path, options, {}).front());
}

std::vector<TriangleMesh> readObjByMaterial(const std::filesystem::path& path, const MeshOptions& options,
                                            const ObjSelection& selection) {
  return nameErrors(path, [&] {
    ObjData data = parseObj(readFile(path));
    select(data, selection);
    if (data.faces.empty()) throw std::runtime_error("has no triangles");
    std::vector<TriangleMesh> meshes;
    for (const std::vector<Run>& runs : divide(data, selection)) meshes.push_back(buildPart(data, runs, options));
    return meshes;
  });
}

}  // namespace lobe
