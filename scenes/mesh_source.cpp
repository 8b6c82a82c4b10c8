#include "scenes/mesh_source.h"

#include "scenes/obj.h"
#include "scenes/ply.h"
#include "scenes/serialized.h"

namespace lobe {

TriangleMesh readMesh(const MeshSource& source, const MeshOptions& options) {
  if (source.type == "obj") return readObj(source.path, options);
  if (source.type == "ply") return readPly(source.path, options);
  return readSerialized(source.path, source.index, options);
}

}  // namespace lobe
