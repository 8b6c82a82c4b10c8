#pragma once
// Materials from the libraries (MTL) of OBJ files, as in Mitsuba 0.6.

#include <map>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "scenes/meshes/mesh_source.h"
#include "scenes/meshes/mtl.h"
#include "scenes/meshes/obj_text.h"
#include "scenes/mitsuba/reader_materials.h"

namespace lobe {

class ObjMaterialReader {
 public:
  ObjMaterialReader(ReadContext& context, TextureReader& textures, MaterialReader& materials)
      : context_(context), textures_(textures), materials_(materials) {}

  /// Names and indices in Scene::materials of the library's materials for the OBJ's selected faces, except those whose
  /// names the selection contains already. A missing or malformed library and a missing image cause a warning at the
  /// location, which is that of the OBJ's file name in the shape. Throws SceneError if a file cannot be read.
  std::vector<std::pair<std::string, int>> read(pugi::xml_node shape, std::ptrdiff_t location,
                                                const MeshSource& source);

 private:
  /// The common context of everything that is read for one shape.
  struct Place {
    pugi::xml_node shape;
    std::ptrdiff_t location;
    std::filesystem::path folder;   ///< of the OBJ
    std::filesystem::path library;  ///< empty if there is none
  };

  /// The materials that the selected faces name. A file is read once for all shapes with the same selection.
  const ObjMaterials& find(std::ptrdiff_t location, const MeshSource& source);
  /// The content of a file. what: of the message of the SceneError that is thrown if it cannot be read.
  std::string textOf(std::ptrdiff_t location, const std::filesystem::path& path, const std::string& what) const;
  /// Path of a file that the OBJ or its library names: in the folder of the OBJ, or where files of the scene are
  /// searched.
  std::filesystem::path resolve(const Place& place, std::string name) const;
  /// By name. If several materials have the same name, the last one is used.
  using Library = std::map<std::string, MtlMaterial>;
  const Library& library(const Place& place);
  Library readLibrary(const Place& place) const;
  int use(const Place& place, const MtlMaterial& material);
  MaterialReader::Made make(const Place& place, const MtlMaterial& material);
  MaterialReader::Made makeModel(const Place& place, const MtlMaterial& material);
  MaterialReader::Made makeOf(const Place& place, const MtlMaterial& material, const std::string& type,
                              Parameters parameters, const std::vector<std::uint64_t>& children = {});
  MaterialReader::Made wrap(const Place& place, const MtlMaterial& material, const std::string& type,
                            Parameters parameters, const MaterialReader::Made& nested);
  TexturePtr texture(const Place& place, const std::string& file, Encoded encoded);
  void setColour(const Place& place, const Rgb& colour, const std::string& file, const std::string& name,
                 Parameters& parameters);

  ReadContext& context_;
  TextureReader& textures_;
  MaterialReader& materials_;
  std::map<std::tuple<std::filesystem::path, int, ObjGrouping>, ObjMaterials> found_;  // by file and selection
  std::map<std::filesystem::path, Library> libraries_;
  // By name and library. Names differ more often than paths, and are quicker to compare.
  std::map<std::pair<std::string, std::filesystem::path>, int> used_;
};

}  // namespace lobe
