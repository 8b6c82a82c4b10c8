#include "scenes/mitsuba/reader_obj_materials.h"

#include <algorithm>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "runtime/core/files.h"
#include "scenes/mitsuba/file_search.h"
#include "scenes/mitsuba/reader_parameters.h"

namespace lobe {
std::vector<std::pair<std::string, int>> ObjMaterialReader::read(pugi::xml_node shape, std::ptrdiff_t location,
                                                                 const MeshSource& source) {
  const ObjMaterials& found = find(location, source);
  if (found.library.empty()) return {};
  Place place{shape, location, source.path.parent_path(), {}};
  place.library = resolve(place, found.library);
  const Library& known = library(place);
  const std::set<std::string> given(source.obj.materials.begin(), source.obj.materials.end());
  std::vector<std::pair<std::string, int>> result;
  for (const std::string& name : found.names) {
    if (given.contains(name)) continue;
    if (const auto entry = known.find(name); entry != known.end()) result.emplace_back(name, use(place, entry->second));
  }
  return result;
}

const ObjMaterials& ObjMaterialReader::find(std::ptrdiff_t location, const MeshSource& source) {
  const std::tuple key(source.path, source.obj.mesh, source.obj.grouping);
  if (const auto known = found_.find(key); known != found_.end()) return known->second;
  const std::string text = textOf(location, source.path, "shape \"obj\"");
  ObjMaterials found = findObjMaterials(text, source.obj.mesh);
  if (source.obj.grouping == ObjGrouping::collapsed) found.names = {found.last};
  return found_.emplace(key, std::move(found)).first->second;
}

std::string ObjMaterialReader::textOf(std::ptrdiff_t location, const std::filesystem::path& path,
                                      const std::string& what) const {
  try {
    return nameErrors(path, [&] { return readFile(path); });
  } catch (const std::runtime_error& error) {
    context_.file.fail(location, fmt::format("{}: {}", what, error.what()));
  }
}

std::filesystem::path ObjMaterialReader::resolve(const Place& place, std::string name) const {
  std::ranges::replace(name, '\\', '/');
  const std::filesystem::path bare = std::filesystem::path(name).filename();
  for (const std::filesystem::path& candidate : {std::filesystem::path(name), bare}) {
    if (pathExists(place.folder / candidate)) {
      context_.findings.addFile(place.folder / candidate);
      return place.folder / candidate;
    }
    std::filesystem::path elsewhere = context_.file.resolve(candidate.string(), place.location);
    if (pathExists(elsewhere)) return elsewhere;
  }
  return context_.file.resolve((place.folder / name).string(), place.location);
}

const ObjMaterialReader::Library& ObjMaterialReader::library(const Place& place) {
  if (const auto known = libraries_.find(place.library); known != libraries_.end()) return known->second;
  return libraries_.emplace(place.library, readLibrary(place)).first->second;
}

ObjMaterialReader::Library ObjMaterialReader::readLibrary(const Place& place) const {
  const std::string what = fmt::format("{}: material library", describe(place.shape));
  Library library;
  try {
    if (!pathExists(place.library)) throw std::runtime_error(place.library.string() + ": no such file");
    const std::string text = textOf(place.location, place.library, what);
    for (MtlMaterial& material : nameErrors(place.library, [&] { return parseMtl(text); }))
      library[material.name] = std::move(material);
  } catch (const SceneError&) {
    throw;
  } catch (const std::runtime_error& error) {
    context_.warn(place.location, fmt::format("material library {}", place.library.string()),
                  fmt::format("{}: {}: diffuse 0.5 is used", what, error.what()));
  }
  return library;
}

int ObjMaterialReader::use(const Place& place, const MtlMaterial& material) {
  const std::pair key(material.name, place.library);
  if (const auto known = used_.find(key); known != used_.end()) return known->second;
  const int index = materials_.add(material.name, make(place, material));
  return used_.emplace(key, index).first->second;
}

MaterialReader::Made ObjMaterialReader::make(const Place& place, const MtlMaterial& material) {
  for (const std::string& fault : material.faults)
    context_.warn(place.location, fault, fmt::format("{}: {}", place.library.string(), fault));
  MaterialReader::Made made = makeModel(place, material);
  if (!material.bumpFile.empty()) {
    Parameters parameters;
    parameters.set("texture", texture(place, material.bumpFile, Encoded::asGivenSigned), place.location);
    made = wrap(place, material, "bumpmap", std::move(parameters), made);
  }
  if (!material.opacityFile.empty() || material.opacity != 1.0f) {
    Parameters parameters;
    setColour(place, grey(material.opacity), material.opacityFile, "opacity", parameters);
    made = wrap(place, material, "mask", std::move(parameters), made);
  }
  return made;
}

/// Maps the numbers of illumination models to BSDFs as in Mitsuba 0.6.
MaterialReader::Made ObjMaterialReader::makeModel(const Place& place, const MtlMaterial& material) {
  Parameters parameters;
  const int model = material.illumination;
  if (model == 4 || model == 6 || model == 7 || model == 9) return makeOf(place, material, "dielectric", parameters);
  if (model == 5 || model == 8) {
    parameters.set("material", std::string("Al"), place.location);
    return makeOf(place, material, "conductor", std::move(parameters));
  }
  const bool shines = (!material.specularFile.empty() || !material.specular.isZero()) && material.exponent != 0.0f;
  const bool phong = model == 2 && shines;
  setColour(place, material.diffuse, material.diffuseFile, phong ? "diffuse_reflectance" : "reflectance", parameters);
  if (!phong) return makeOf(place, material, "diffuse", std::move(parameters));
  setColour(place, material.specular, material.specularFile, "specular_reflectance", parameters);
  parameters.set("exponent", static_cast<double>(material.exponent), place.location);
  return makeOf(place, material, "phong", std::move(parameters));
}

MaterialReader::Made ObjMaterialReader::makeOf(const Place& place, const MtlMaterial& material, const std::string& type,
                                               Parameters parameters, const std::vector<std::uint64_t>& children) {
  // Mitsuba 0.6, the only version that reads libraries, keeps reflectances from exceeding 1.
  parameters.setDefault("ensure_energy_conservation", true);
  return makeFrom(context_, place.shape, std::move(parameters), [&](const Parameters& p) {
    try {
      return MaterialReader::makeOf(type, p, children);
    } catch (const ParameterError& error) {
      throw ParameterError(error.name,
                           fmt::format("{}: material \"{}\": {}", place.library.string(), material.name, error.what()));
    }
  });
}

MaterialReader::Made ObjMaterialReader::wrap(const Place& place, const MtlMaterial& material, const std::string& type,
                                             Parameters parameters, const MaterialReader::Made& nested) {
  parameters.addChild(nested.bsdf);
  return makeOf(place, material, type, std::move(parameters), {nested.fingerprint});
}

TexturePtr ObjMaterialReader::texture(const Place& place, const std::string& file, Encoded encoded) {
  const std::filesystem::path path = resolve(place, file);
  if (pathExists(path)) return textures_.readFile(place.shape, place.location, path, encoded);
  context_.warn(place.location, "missing image " + path.string(),
                fmt::format("{}: {}: image {} does not exist: black is used", describe(place.shape),
                            place.library.string(), path.string()));
  return constantTexture(Rgb::Zero());
}

void ObjMaterialReader::setColour(const Place& place, const Rgb& colour, const std::string& file,
                                  const std::string& name, Parameters& parameters) {
  if (file.empty())
    parameters.set(name, colour, place.location);
  else
    parameters.set(name, texture(place, file, Encoded::asGiven), place.location);
}

}  // namespace lobe
