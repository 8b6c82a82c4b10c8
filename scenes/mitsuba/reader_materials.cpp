#include "scenes/mitsuba/reader_materials.h"

#include <algorithm>

#include <fmt/format.h>

#include "materials/registry.h"
#include "runtime/core/fingerprint.h"
#include "scenes/mitsuba/reader_parameters.h"
#include "scenes/mitsuba/values.h"

namespace lobe {
namespace {

/// children: fingerprints of the nested BSDFs. The data in the file of a measured BSDF is covered by the keys of its
/// lobes.
std::uint64_t fingerprintOf(const std::string& type, const Parameters& parameters,
                            std::span<const std::uint64_t> children, const Bsdf& bsdf) {
  Fingerprint hash;
  hash.text(type);
  hash.number(parameters.fingerprint());
  hash.array(children);
  for (const LobePtr& lobe : bsdf.lobes()) hash.text(lobe->key());
  return hash.value();
}

/// Defaults that depend on the version of the file. Mitsuba 0.6 keeps reflectances from exceeding 1. From version 2, a
/// metal that is not named is a perfect mirror (η = 0, k = 1) rather than copper, and the opacity of a mask is a number
/// rather than a colour. From version 3 (3.7), normals of bump and normal maps are flipped towards the viewer, and a
/// shadowing function is applied at their terminator.
void setDefaults(const std::string& type, int version, Parameters& parameters) {
  if (version < 2) return parameters.setDefault("ensure_energy_conservation", true);
  if (type == "conductor" || type == "roughconductor") parameters.setDefault("material", std::string("none"));
  if (type == "mask" && parameters.varies("opacity"))
    parameters.set("opacity", numbersOf(parameters.texture("opacity", grey(1.0f))), parameters.location("opacity"));
  if (version < 3 || (type != "bumpmap" && type != "normalmap")) return;
  parameters.setDefault("flip_invalid_normals", true);
  parameters.setDefault("use_shadowing_function", true);
}

bool namesMeasurement(pugi::xml_node node) {
  const std::string_view type = node.attribute("type").value();
  return elementName(node) == "bsdf" && (type == "measured" || type == "merl");
}

std::variant<BsdfPtr, ParameterError> bsdfOrFault(const std::string& type, const Parameters& parameters) {
  try {
    return makeBsdf(type, parameters);
  } catch (const ParameterError& error) {
    return error;
  }
}

}  // namespace

void MaterialReader::check(pugi::xml_node node) {
  if (!namesMeasurement(node) && !node.find_node(namesMeasurement)) read(node);
}

MaterialReader::Made MaterialReader::makeOf(const std::string& type, const Parameters& parameters,
                                            const std::vector<std::uint64_t>& children) {
  const BsdfPtr bsdf = makeBsdf(type, parameters);
  return {bsdf, fingerprintOf(type, parameters, children, *bsdf)};
}

MaterialReader::Made MaterialReader::makeDiffuseOf(float reflectance) {
  Parameters parameters;
  parameters.set("reflectance", static_cast<double>(reflectance));
  return makeOf("diffuse", parameters);
}

const MaterialReader::Made& MaterialReader::done(pugi::xml_node node) {
  const auto [entry, isNew] = done_.try_emplace(SceneFile::location(node));
  if (isNew) {
    Made made;
    const auto read = [&] {
      const Nesting nesting(context_, node, depth_);
      made = make(node);
    };
    if (!context_.attempt("diffuse 0.5 is used", read)) made = makeDiffuseOf(0.5f);
    entry->second = std::move(made);
  } else if (!entry->second.bsdf) {
    context_.unsupported(node, fmt::format("circle at {}", SceneFile::location(node)), "a bsdf that refers to itself",
                         "diffuse 0.5 is used in it");
    return circular_;
  }
  return entry->second;
}

MaterialReader::Made MaterialReader::make(pugi::xml_node node) {
  const std::string type = typeOf(context_, node);
  const std::vector<std::string> known = knownBsdfs();
  if (std::ranges::find(known, type) == known.end()) {
    context_.unsupported(
        node, "bsdf " + type,
        fmt::format("unknown bsdf type \"{}\"; {}", type, knownAre(type, fmt::format("{}", fmt::join(known, ", ")))),
        "diffuse 0.5 is used");
    return makeDiffuseOf(0.5f);
  }
  // Normals and heights are not colours.
  const Encoded encoded = type == "normalmap" ? Encoded::linear
                          : type == "bumpmap" ? Encoded::asGivenSigned
                                              : Encoded::asGiven;
  int parts = 1;
  std::vector<std::uint64_t> children;
  // A file can have more parts than an int counts.
  const auto count = [&parts](int more) { parts = std::min(parts + more, kMostParts + 1); };
  const auto onChild = [&](pugi::xml_node child, const std::string& name, Parameters& parameters) {
    if (elementName(child) != "bsdf") {
      if (!textures_.take(child, name, parameters, encoded)) return false;
      count(textures_.partsOf(child, encoded));
      return true;
    }
    const Made& nested = done(child);
    parameters.addChild(nested.bsdf);
    children.push_back(nested.fingerprint);
    count(nested.parts);
    return true;
  };
  Parameters parameters = readParameters(context_, node, "texture, bsdf, ref", onChild);
  // Evaluating the BSDF evaluates all of them, and one that is referenced twice is evaluated twice.
  if (parts > kMostParts)
    context_.file.fail(node, fmt::format("{}: more than {} nested bsdfs and textures", describe(node), kMostParts));
  setDefaults(type, context_.file.majorVersion(), parameters);
  if (namesMeasurement(node)) {
    if (!resolveFile(node, parameters)) return makeDiffuseOf(0.5f);
    return makeMeasured(node, type, parameters);
  }
  const BsdfPtr bsdf = makeFrom(context_, node, parameters, [&](const Parameters& p) { return makeBsdf(type, p); });
  return {bsdf, fingerprintOf(type, parameters, children, *bsdf), parts};
}

MaterialReader::Made MaterialReader::makeMeasured(pugi::xml_node node, const std::string& type,
                                                  const Parameters& parameters) {
  const BsdfPtr bsdf = makeFrom(context_, node, parameters, [&](const Parameters& p) { return readMeasured(type, p); });
  return {bsdf, fingerprintOf(type, parameters, {}, *bsdf)};
}

BsdfPtr MaterialReader::readMeasured(const std::string& type, const Parameters& parameters) {
  if (!parameters.holdsText("filename")) return makeBsdf(type, parameters);  // reports the error
  const std::pair key(type, parameters.text("filename", ""));
  auto known = measured_.find(key);
  if (known == measured_.end()) known = measured_.emplace(key, bsdfOrFault(type, parameters)).first;
  if (const auto* bsdf = std::get_if<BsdfPtr>(&known->second)) return *bsdf;
  throw ParameterError(std::get<ParameterError>(known->second));
}

bool MaterialReader::resolveFile(pugi::xml_node node, Parameters& parameters) {
  if (!parameters.holdsText("filename")) return true;  // makeBsdf reports the error
  const std::ptrdiff_t location = parameters.location("filename");
  const std::filesystem::path path = context_.file.resolve(parameters.text("filename", ""), location);
  if (!pathExists(path)) {
    context_.unsupported(location, "missing file " + path.string(),
                         fmt::format("{}: {} does not exist", describe(node), path.string()), "diffuse 0.5 is used");
    return false;
  }
  parameters.set("filename", path.string(), location);
  return true;
}

int MaterialReader::use(pugi::xml_node node) {
  const auto [entry, isNew] = materials_.try_emplace(SceneFile::location(node));
  if (isNew) entry->second = add(node.attribute("id").value(), done(node));
  return entry->second;
}

int MaterialReader::useDefault(bool emits) {
  const auto [entry, isNew] = materials_.try_emplace(emits ? -2 : -1);
  if (isNew) entry->second = add("", makeDiffuseOf(emits ? 0.0f : 0.5f));
  return entry->second;
}

int MaterialReader::add(std::string name, const Made& made) {
  if (name.empty()) name = fmt::format("unnamed-{}", ++unnamed_);
  context_.scene.materials.push_back({std::move(name), made.bsdf, made.fingerprint});
  return static_cast<int>(context_.scene.materials.size()) - 1;
}

}  // namespace lobe
