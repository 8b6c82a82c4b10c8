#pragma once
// BSDF elements of scene files, and the list of those that shapes use.

#include <map>
#include <string>
#include <utility>
#include <variant>

#include "scenes/mitsuba/reader_textures.h"

namespace lobe {

class MaterialReader {
 public:
  MaterialReader(ReadContext& context, TextureReader& textures) : context_(context), textures_(textures) {}

  /// Reads an element at the top level of the scene, so that its faults are found even if it is not used. Measured
  /// materials are read only when they are used, because their files are large and may be missing.
  void check(pugi::xml_node node);

  /// Each element is read once. If it cannot be read, a fault is reported and it becomes diffuse 0.5.
  BsdfPtr read(pugi::xml_node node) { return done(node).bsdf; }

  /// The index in Scene::materials of the element's BSDF, which is added on its first use.
  int use(pugi::xml_node node);
  /// The same for shapes without a BSDF: diffuse 0.5 as in Mitsuba, or black for emitters as in Mitsuba 3.
  int useDefault(bool emits);

  /// A BSDF and the hash of everything that it is made from.
  struct Made {
    BsdfPtr bsdf;  ///< null while being read
    std::uint64_t fingerprint = 0;
    int parts = 1;  ///< this BSDF and the BSDFs and textures nested in it, counted as often as they are evaluated
  };
  /// Creates a BSDF that does not belong to an element, from its parameters, which include nested BSDFs; children: the
  /// fingerprints of those. Throws ParameterError.
  static Made makeOf(const std::string& type, const Parameters& parameters,
                     const std::vector<std::uint64_t>& children = {});
  /// Adds a material and returns its index in Scene::materials; an empty name is replaced by "unnamed-N".
  int add(std::string name, const Made& made);

 private:
  static Made makeDiffuseOf(float reflectance);
  const Made& done(pugi::xml_node node);
  Made make(pugi::xml_node node);
  Made makeMeasured(pugi::xml_node node, const std::string& type, const Parameters& parameters);
  /// A BSDF from a file, which is its only parameter; elements with the same file share it, or its fault. Throws
  /// ParameterError.
  BsdfPtr readMeasured(const std::string& type, const Parameters& parameters);
  /// Resolves the file name relative to the scene. Returns false, after reporting a fault, when the file does not
  /// exist.
  bool resolveFile(pugi::xml_node node, Parameters& parameters);

  ReadContext& context_;
  TextureReader& textures_;

  std::map<std::ptrdiff_t, Made> done_;  // by location; without a BSDF while being read
  std::map<std::pair<std::string, std::string>, std::variant<BsdfPtr, ParameterError>> measured_;  // by type and file
  Made circular_ = makeDiffuseOf(0.5f);      // replaces a BSDF inside itself
  std::map<std::ptrdiff_t, int> materials_;  // by location; the defaults at −1 and −2
  int unnamed_ = 0;
  int depth_ = 0;  // of the BSDF being read
};

}  // namespace lobe
