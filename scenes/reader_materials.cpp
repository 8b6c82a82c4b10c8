#include "scenes/reader_materials.h"

#include <algorithm>

#include <fmt/format.h>

#include "materials/registry.h"
#include "scenes/reader_parameters.h"
#include "scenes/values.h"

namespace lobe {
namespace {

BsdfPtr makeDiffuseOf(float reflectance) {
  Parameters parameters;
  parameters.set("reflectance", static_cast<double>(reflectance));
  return makeBsdf("diffuse", parameters);
}

/// What Mitsuba 3 changed: a metal that is not named is a perfect mirror (η 0, k 1) rather than copper.
void setDefaultsOfToday(const std::string& type, Parameters& parameters) {
  if ((type == "conductor" || type == "roughconductor") && !parameters.has("material"))
    parameters.set("material", std::string("none"));
}

bool namesMeasurement(pugi::xml_node node) {
  const std::string_view type = node.attribute("type").value();
  return elementName(node) == "bsdf" && (type == "measured" || type == "merl");
}

}  // namespace

void MaterialReader::check(pugi::xml_node node) {
  if (!namesMeasurement(node) && !node.find_node(namesMeasurement)) read(node);
}

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
    context_.unsupported(
        node, "bsdf " + type,
        fmt::format("unknown bsdf type \"{}\"; {}", type, knownAre(type, fmt::format("{}", fmt::join(known, ", ")))),
        "diffuse 0.5 is used");
    return makeDiffuseOf(0.5f);
  }
  // Directions are no colours, and neither are heights.
  const Encoded encoded = type == "normalmap" ? Encoded::linear
                          : type == "bumpmap" ? Encoded::asGivenSigned
                                              : Encoded::asGiven;
  const auto onChild = [&](pugi::xml_node child, const std::string& name, Parameters& parameters) {
    if (elementName(child) != "bsdf") return textures_.take(child, name, parameters, encoded);
    parameters.addChild(read(child));
    return true;
  };
  Parameters parameters = readParameters(context_, node, "texture, bsdf, ref", onChild);
  if (context_.file.isOfToday()) setDefaultsOfToday(type, parameters);
  if (namesMeasurement(node) && !resolveFile(node, parameters)) return makeDiffuseOf(0.5f);
  return makeFrom(context_, node, parameters, [&](const Parameters& p) { return makeBsdf(type, p); });
}

bool MaterialReader::resolveFile(pugi::xml_node node, Parameters& parameters) {
  if (!parameters.holdsText("filename")) return true;  // the model says what is wrong
  const std::filesystem::path path = context_.file.resolve(parameters.text("filename", ""));
  const std::ptrdiff_t location = parameters.location("filename");
  if (!std::filesystem::exists(path)) {
    context_.unsupported(location, "missing file " + path.string(),
                         fmt::format("{}: {} is not there", describe(node), path.string()), "diffuse 0.5 is used");
    return false;
  }
  parameters.set("filename", path.string(), location);
  return true;
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
