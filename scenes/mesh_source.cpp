#include "scenes/mesh_source.h"

#include "scenes/obj.h"
#include "scenes/ply.h"
#include "scenes/serialized.h"

namespace lobe {

std::vector<TriangleMesh> readMeshes(const MeshSource& source, const MeshOptions& options) {
  if (source.type == "obj") return readObjByMaterial(source.path, options, source.obj);
  if (source.type == "ply") return {readPly(source.path, options)};
  return {readSerialized(source.path, source.index, options)};
}

}  // namespace lobe
