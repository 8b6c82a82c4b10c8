#pragma once
// BSDF elements of scene files, and the list of those that shapes use.

#include <map>

#include "scenes/mitsuba/reader_textures.h"

namespace lobe {

class MaterialReader {
 public:
  MaterialReader(ReadContext& context, TextureReader& textures) : context_(context), textures_(textures) {}

  /// Reads an element that the scene has at its top, so that its faults are found whether it is used or not; except
  /// that measured materials, whose files are large and need not be there, are left until something uses them.
  void check(pugi::xml_node node);

  /// Each element is read once; what cannot be read is a fault, and diffuse 0.5.
  BsdfPtr read(pugi::xml_node node) { return done(node).bsdf; }

  /// The index in Scene::materials of the element's BSDF, which is added when it is the first use.
  int use(pugi::xml_node node);
  /// The same for shapes without a BSDF: diffuse 0.5 as in Mitsuba, or black as in Mitsuba 3 where they emit.
  int useDefault(bool emits);

  /// A BSDF, and of what it was made.
  struct Made {
    BsdfPtr bsdf;  ///< null while being read
    std::uint64_t fingerprint = 0;
    int parts = 1;  ///< this BSDF and, as often as they are asked, those nested in it
  };
  /// Makes one that stands in no element, of parameters with their children, of which the fingerprints are given.
  /// Throws ParameterError.
  static Made makeOf(const std::string& type, const Parameters& parameters,
                     const std::vector<std::uint64_t>& children = {});
  /// The index in Scene::materials where it is put; an empty name becomes one of ours.
  int add(std::string name, const Made& made);

 private:
  static Made makeDiffuseOf(float reflectance);
  const Made& done(pugi::xml_node node);
  Made make(pugi::xml_node node);
  /// Makes the file's name one from the scene's folder. Returns whether the file is there, if its lack is tolerated.
  bool resolveFile(pugi::xml_node node, Parameters& parameters);

  ReadContext& context_;
  TextureReader& textures_;
  std::map<std::ptrdiff_t, Made> done_;      // by place; without a BSDF while being read
  Made circular_ = makeDiffuseOf(0.5f);      // stands for a BSDF inside itself
  std::map<std::ptrdiff_t, int> materials_;  // by place; the defaults at −1 and −2
  int unnamed_ = 0;
  int depth_ = 0;  // of the BSDF being read
};

}  // namespace lobe
