#include "scenes/obj.h"

#include <algorithm>
#include <sstream>
#include <stdexcept>
#include <string_view>

#include <fmt/format.h>
#include <tiny_obj_loader.h>

#include "scenes/mesh_file.h"
#include "scenes/polygon.h"
#include "scenes/world_mesh.h"

namespace lobe {
namespace {

constexpr int kNone = -1;
constexpr int kInvalid = -2;

/// Indices from zero into the lists of the file; kNone for what the corner does not have.
struct Corner {
  int position, uv, normal;
};

struct ObjData {
  std::vector<Vec3> positions;
  std::vector<Vec2> uvs;
  std::vector<Vec3> normals;
  std::vector<Corner> corners;           ///< of all faces, one after the other
  std::vector<std::size_t> faceEnds{0};  ///< face i has the corners from faceEnds[i] to before faceEnds[i + 1]
  std::vector<int> faceParts;  ///< of each face: the index of its material among those asked for, or their count
  int part = 0;                ///< of the faces to come
};

// ---- What the library lets pass in silence: it reads 0 for any number it cannot make out.

constexpr std::string_view kBlanks = " \t\r";

/// The number of blank-separated words made of the allowed characters; -1 when there are others.
int countWords(std::string_view text, std::string_view allowed) {
  int words = 0;
  bool inside = false;
  for (const char c : text) {
    const bool blank = kBlanks.find(c) != std::string_view::npos;
    if (!blank && allowed.find(c) == std::string_view::npos) return -1;
    if (!blank && !inside) ++words;
    inside = !blank;
  }
  return words;
}

bool lineIsSound(std::string_view line) {
  line.remove_prefix(std::min(line.find_first_not_of(kBlanks), line.size()));
  const std::string_view key = line.substr(0, line.find_first_of(kBlanks));
  if (key != "v" && key != "vn" && key != "vt" && key != "f") return true;
  const std::string_view rest = line.substr(key.size(), line.find('#') - key.size());
  if (key == "f") return countWords(rest, "0123456789-+/") >= 0;
  return countWords(rest, "0123456789-+.eE") >= (key == "vt" ? 1 : 3);
}

void requireSoundLines(std::string_view text) {
  for (std::size_t number = 1, begin = 0; begin < text.size(); ++number) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view line = text.substr(begin, end - begin);
    if (!lineIsSound(line)) throw std::runtime_error(fmt::format("line {} is not understood", number));
    begin = end + 1;
  }
}

// ---- Reading

/// OBJ counts from 1, or backwards from the latest by negative numbers.
int resolve(int index, std::size_t count) {
  if (index == 0) return kNone;
  if (index > 0) return index - 1;
  const long resolved = static_cast<long>(count) + index;
  return resolved >= 0 ? static_cast<int>(resolved) : kInvalid;
}

struct ObjParser {
  ObjData data;
  const std::vector<std::string>& materials;
};

ObjData& dataOf(void* user) {
  return static_cast<ObjParser*>(user)->data;
}

void takeMaterial(void* user, const char* name, int) {
  ObjParser& parser = *static_cast<ObjParser*>(user);
  parser.data.part = static_cast<int>(std::ranges::find(parser.materials, name) - parser.materials.begin());
}

void takeFace(void* user, tinyobj::index_t* indices, int count) {
  if (count < 3) return;
  ObjData& data = dataOf(user);
  for (int i = 0; i < count; ++i)
    data.corners.push_back({resolve(indices[i].vertex_index, data.positions.size()),
                            resolve(indices[i].texcoord_index, data.uvs.size()),
                            resolve(indices[i].normal_index, data.normals.size())});
  data.faceEnds.push_back(data.corners.size());
  data.faceParts.push_back(data.part);
}

void requireIndicesInRange(const ObjData& data) {
  const auto check = [](int index, std::size_t count, bool optional, const char* what) {
    if (optional && index == kNone) return;
    if (index < 0 || static_cast<std::size_t>(index) >= count)
      throw std::runtime_error(fmt::format("a face refers to a {} that is not there (there are {})", what, count));
  };
  for (const Corner& corner : data.corners) {
    check(corner.position, data.positions.size(), false, "vertex");
    check(corner.uv, data.uvs.size(), true, "texture coordinate");
    check(corner.normal, data.normals.size(), true, "normal");
  }
}

/// Drops what not all corners have (normals), or none (texture coordinates; the others get the origin).
void dropUnused(ObjData& data, bool faceNormals) {
  const bool allNormals = std::ranges::none_of(data.corners, [](const Corner& c) { return c.normal == kNone; });
  const bool anyUvs = std::ranges::any_of(data.corners, [](const Corner& c) { return c.uv != kNone; });
  if (faceNormals || !allNormals) data.normals.clear();
  if (!anyUvs) data.uvs.clear();
  if (data.normals.empty())
    for (Corner& corner : data.corners) corner.normal = kNone;
}

ObjData parseObj(std::string text, bool faceNormals, const std::vector<std::string>& materials) {
  requireSoundLines(text);
  tinyobj::callback_t callback;
  callback.vertex_cb = [](void* user, float x, float y, float z, float) {
    dataOf(user).positions.emplace_back(x, y, z);
  };
  callback.normal_cb = [](void* user, float x, float y, float z) { dataOf(user).normals.emplace_back(x, y, z); };
  // Textures have v downwards, the file upwards.
  callback.texcoord_cb = [](void* user, float u, float v, float) { dataOf(user).uvs.emplace_back(u, 1.0f - v); };
  callback.index_cb = takeFace;
  callback.usemtl_cb = takeMaterial;

  ObjParser parser{{}, materials};
  parser.data.part = static_cast<int>(materials.size());
  std::istringstream stream(std::move(text));
  std::string error;
  if (!tinyobj::LoadObjWithCallback(stream, callback, &parser, nullptr, nullptr, &error))
    throw std::runtime_error(error.substr(0, error.find('\n')));
  requireIndicesInRange(parser.data);
  dropUnused(parser.data, faceNormals);
  return std::move(parser.data);
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
    const ObjData data = parseObj(readBytes(path), options.faceNormals, materials);
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
