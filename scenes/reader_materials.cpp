#include "scenes/reader_materials.h"

#include <algorithm>

#include <fmt/format.h>

#include "materials/registry.h"
#include "scenes/reader_parameters.h"

namespace lobe {
namespace {

BsdfPtr makeDiffuseOf(float reflectance) {
  Parameters parameters;
  parameters.set("reflectance", static_cast<double>(reflectance));
  return makeBsdf("diffuse", parameters);
}

}  // namespace

BsdfPtr MaterialReader::read(pugi::xml_node node) {
  const auto [entry, isNew] = done_.try_emplace(SceneFile::location(node));
  if (isNew)
    entry->second = make(node);
  else if (!entry->second)
    context_.file.fail(node, "a bsdf that refers to itself");
  return entry->second;
}

BsdfPtr MaterialReader::make(pugi::xml_node node) {
  const std::string type = typeOf(context_, node);
  const std::vector<std::string> known = knownBsdfs();
  if (std::ranges::find(known, type) == known.end()) {
    context_.unsupported(node, "bsdf " + type,
                         fmt::format("unknown bsdf type \"{}\"; known are {}", type, fmt::join(known, ", ")),
                         "diffuse 0.5 is used");
    return makeDiffuseOf(0.5f);
  }
  // Directions are no colours.
  const Encoded encoded = type == "normalmap" ? Encoded::linear : Encoded::asGiven;
  const auto onChild = [&](pugi::xml_node child, const std::string& name, Parameters& parameters) {
    if (elementName(child) != "bsdf") return textures_.take(child, name, parameters, encoded);
    parameters.addChild(read(child));
    return true;
  };
  const Parameters parameters = readParameters(context_, node, "texture, bsdf, ref", onChild);
  return makeFrom(context_, node, parameters, [&](const Parameters& p) { return makeBsdf(type, p); });
}

int MaterialReader::use(pugi::xml_node node) {
  const auto [entry, isNew] = materials_.try_emplace(SceneFile::location(node));
  if (isNew) entry->second = add(node.attribute("id").value(), read(node));
  return entry->second;
}

int MaterialReader::useDefault(bool emits) {
  const auto [entry, isNew] = materials_.try_emplace(emits ? -2 : -1);
  if (isNew) entry->second = add("", makeDiffuseOf(emits ? 0.0f : 0.5f));
  return entry->second;
}

int MaterialReader::add(std::string name, BsdfPtr bsdf) {
  if (name.empty()) name = fmt::format("unnamed-{}", ++unnamed_);
  context_.scene.materials.push_back({std::move(name), std::move(bsdf)});
  return static_cast<int>(context_.scene.materials.size()) - 1;
}

}  // namespace lobe
