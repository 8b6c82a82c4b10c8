#pragma once
// Shape elements of scene files.

#include <map>

#include "scenes/meshes/mesh_budget.h"
#include "scenes/meshes/mesh_options.h"
#include "scenes/meshes/mesh_source.h"
#include "scenes/mitsuba/reader_materials.h"
#include "scenes/mitsuba/reader_obj_materials.h"

namespace lobe {

class ShapeReader {
 public:
  /// harmless: the number of triangles and vertices of all meshes that is accepted whatever the sizes of their files.
  ShapeReader(ReadContext& context, TextureReader& textures, MaterialReader& materials,
              std::uintmax_t harmless = MeshBudget::kHarmless)
      : context_(context),
        textures_(textures),
        materials_(materials),
        objMaterials_(context, textures, materials),
        budget_(harmless) {}

  /// Adds the shape to the scene; its mesh is left for readMeshes. Throws SceneError.
  void add(pugi::xml_node node);
  /// Reads the meshes of all shapes added, in parallel. A mesh that cannot be read is reported as a fault and left out.
  /// If the meshes exceed the limit of MeshBudget together, reading ends, and this applies to all of them.
  void readMeshes();
  /// Reports a fault for each instance that rays cannot be traced in, and leaves it out. The scene must have its final
  /// scale.
  void leaveOutFlatInstances();

 private:
  struct Parts {
    pugi::xml_node bsdf;
    std::vector<std::pair<std::string, pugi::xml_node>> named;  ///< for the OBJ's material of this name
    std::optional<AreaEmitter> emitter;
  };
  /// Where a shape is stored: at the top level of the scene (group −1) or in a group.
  struct Place {
    int group;
    std::size_t index;
  };
  struct Mesh {
    std::vector<Place> shapes;  ///< one for each of the source's materials, then one for the remaining faces
    std::ptrdiff_t location;
    MeshSource source;
    MeshOptions options;
    bool loadMaterials;  ///< from the library that the OBJ names
    bool isNamed;        ///< the only BSDF has a name, which need not be that of a material of the OBJ
    std::string fault;
  };

  void addTo(int group, pugi::xml_node node);
  void addShape(int group, pugi::xml_node node, const std::string& type);
  void addInstance(pugi::xml_node node);
  int groupOf(pugi::xml_node node);
  void readGroup(pugi::xml_node node, int group);
  bool take(pugi::xml_node child, const std::string& name, const std::string& type, Parts& parts);
  void takeBsdf(pugi::xml_node child, const std::string& name, const std::string& type, Parts& parts);
  void takeEmitter(pugi::xml_node node, Parts& parts);
  Mesh makeMesh(const std::string& type, const Parameters& parameters, const MeshOptions& options);
  void addMesh(int group, pugi::xml_node node, Mesh mesh, const std::string& name, const Parts& parts);
  /// Those of the OBJ's library. Throws SceneError if the shapes of the scene use too many of them.
  std::vector<std::pair<std::string, int>> libraryMaterials(pugi::xml_node node, const Mesh& mesh);
  int materialOf(const Parts& parts);
  std::vector<Shape>& shapesOf(int group) {
    return group < 0 ? context_.scene.shapes : context_.scene.groups[static_cast<std::size_t>(group)].shapes;
  }
  void read(Mesh& mesh);
  void leaveOutMeshes();
  void reportFault(const Mesh& mesh);
  /// Reports a fault for each instance whose group is too far away, and clears the instance.
  void clearInstancesOutOfRange();
  void dropDuplicates(Shape& shape);
  void limitToMaterial(const Mesh& mesh);
  void noteUnusedMaterials(const Mesh& mesh);
  /// Removes shapes without a triangle, so that the indices of others are not valid any more.
  void dropEmpty();

  ReadContext& context_;
  TextureReader& textures_;
  MaterialReader& materials_;
  ObjMaterialReader objMaterials_;
  std::size_t libraryMaterials_ = 0;  // used by all shapes
  std::vector<Mesh> meshes_;
  MeshBudget budget_;
  // Those in the scene: index into its shapes, valid until dropEmpty, and location in the file.
  std::vector<std::pair<std::size_t, std::ptrdiff_t>> instances_;
  std::map<std::ptrdiff_t, int> groups_;  // by location in the file
};

}  // namespace lobe
