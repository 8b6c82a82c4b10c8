#pragma once
// Shape elements of scene files.

#include "scenes/mesh_options.h"
#include "scenes/reader_materials.h"

namespace lobe {

class ShapeReader {
 public:
  ShapeReader(ReadContext& context, TextureReader& textures, MaterialReader& materials)
      : context_(context), textures_(textures), materials_(materials) {}

  /// Adds the shape to the scene; its mesh is left for readMeshes. Throws SceneError.
  void add(pugi::xml_node node);
  /// Reads the meshes of all shapes added, in parallel. SceneError: the fault of the first shape that has one.
  void readMeshes();

 private:
  struct Parts {
    pugi::xml_node bsdf;
    std::optional<AreaEmitter> emitter;
  };
  struct Mesh {
    std::size_t shape;  // index into Scene::shapes
    std::ptrdiff_t location;
    std::string type;
    std::filesystem::path path;
    MeshOptions options;
    std::string fault;
  };

  bool take(pugi::xml_node child, Parts& parts);
  void takeEmitter(pugi::xml_node node, Parts& parts);
  Shape make(pugi::xml_node node, const std::string& type, const Parameters& parameters);
  void addMesh(const std::string& type, const Parameters& parameters, const MeshOptions& options, Shape& shape);
  void reportFaults();

  ReadContext& context_;
  TextureReader& textures_;
  MaterialReader& materials_;
  std::vector<Mesh> meshes_;
};

}  // namespace lobe
