#include "scenes/meshes/mesh_source.h"

#include "scenes/meshes/obj.h"
#include "scenes/meshes/ply.h"
#include "scenes/meshes/serialized.h"

namespace lobe {

std::vector<TriangleMesh> readMeshes(const MeshSource& source, const MeshOptions& options) {
  if (source.type == "obj") return readObjByMaterial(source.path, options, source.obj);
  if (source.type == "ply") return {readPly(source.path, options)};
  return {readSerialized(source.path, source.index, options)};
}

}  // namespace lobe
