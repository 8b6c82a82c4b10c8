#include "scenes/reader_parameters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/LU>

#include "scenes/mesh_file.h"
#include "scenes/spectra.h"
#include "scenes/transforms.h"
#include "scenes/values.h"

namespace lobe {
namespace {

constexpr std::string_view kValueElements =
    "float, integer, boolean, string, rgb, srgb, xyz, spectrum, blackbody, point, vector, transform";

constexpr std::array<std::string_view, 6> kColours = {"rgb", "srgb", "color", "xyz", "spectrum", "blackbody"};

/// What Mitsuba has and we need not: how it stores or filters things, and what belongs to other ways to render.
constexpr std::pair<std::string_view, std::string_view> kWithoutEffect[] = {
    {"texture \"bitmap\"", "accel, cache, format, max_anisotropy"},
    {"emitter \"constant\"", "to_world"},
    {"emitter \"envmap\"", "cache, mis_compensation"},
    {"emitter \"sky\"", "extend"},
    {"emitter \"sunsky\"", "complex_sun, extend, sun_aperture"},
    {"bsdf \"normalmap\"", "flip_invalid_normals, use_shadowing_function"},
    {"sensor \"orthographic\"", "shutter_close, shutter_open"},
    {"sensor \"perspective\"", "shutter_close, shutter_open"},
    {"sensor \"thinlens\"", "shutter_close, shutter_open"},
    {"shape \"obj\"", "load_materials, shape_index"},
    {"shape \"ply\"", "srgb"},
};

bool hasNoEffect(const std::string& owner, std::string_view name) {
  for (const auto& [element, names] : kWithoutEffect)
    if (element == owner && fmt::format(", {}, ", names).find(fmt::format(", {}, ", name)) != std::string::npos)
      return true;
  return false;
}

std::string text(const ReadContext& context, pugi::xml_node node) {
  checkAttributes(context, node, {"name", "value", "intent"});
  const pugi::xml_attribute value = node.attribute("value");
  if (!value) context.file.fail(node, fmt::format("<{}> needs a value", node.name()));
  return value.value();
}

template <typename T>
T parsed(const ReadContext& context, pugi::xml_node node, std::optional<T> (*parse)(std::string_view),
         std::string_view wanted) {
  const std::string value = text(context, node);
  if (std::optional<T> result = parse(value)) return *result;
  context.file.fail(node,
                    fmt::format("\"{}\" is not {} (parameter \"{}\")", value, wanted, node.attribute("name").value()));
}

std::optional<Rgb> parseRgb(std::string_view text) {
  return text.find('#') == std::string_view::npos ? parseColour(text) : parseSrgb(text);
}

std::optional<Rgb> parseXyz(std::string_view text) {
  const auto values = parseNumbers(text);
  if (!values || values->size() != 3) return std::nullopt;
  return rgbOfXyz(Eigen::Vector3d(values->data()));
}

std::optional<Rgb> parseSpectrumOrColour(std::string_view text) {
  if (const std::optional<SpectrumPoints> points = parseSpectrum(text)) return rgbOfSpectrum(*points);
  return parseColour(text);
}

Rgb readSpectrumFile(const ReadContext& context, pugi::xml_node node) {
  const std::filesystem::path path = context.file.resolve(node.attribute("filename").value());
  try {
    if (const std::optional<SpectrumPoints> points = parseSpectrumFile(readBytes(path))) return rgbOfSpectrum(*points);
  } catch (const std::runtime_error& error) {
    context.file.fail(node, fmt::format("<spectrum>: {}: {}", path.string(), error.what()));
  }
  context.file.fail(
      node, fmt::format("<spectrum>: {} does not hold lines of a wavelength, rising, and a value", path.string()));
}

Rgb readBlackbody(const ReadContext& context, pugi::xml_node node) {
  checkAttributes(context, node, {"name", "temperature", "scale"});
  std::string_view temperature = node.attribute("temperature").value();
  if (temperature.ends_with('K') || temperature.ends_with('k')) temperature.remove_suffix(1);
  const std::optional<double> kelvin = parseNumber(temperature);
  const std::optional<double> scale = parseNumber(node.attribute("scale").as_string("1"));
  if (!kelvin || !(*kelvin >= 100 && *kelvin <= 1e6) || !scale)
    context.file.fail(node, "<blackbody> needs a temperature from 100 to 1e6 such as 5000K, and a number as scale");
  return rgbOfBlackbody(*kelvin) * static_cast<float>(*scale);
}

Rgb readColour(const ReadContext& context, pugi::xml_node node, std::string_view tag) {
  if (tag == "srgb") return parsed<Rgb>(context, node, parseSrgb, "one or three numbers or #rrggbb");
  if (tag == "xyz") return parsed<Rgb>(context, node, parseXyz, "three numbers");
  if (tag == "blackbody") return readBlackbody(context, node);
  if (tag != "spectrum") return parsed<Rgb>(context, node, parseRgb, "one or three numbers or #rrggbb");
  if (node.attribute("filename")) return readSpectrumFile(context, node);
  return parsed<Rgb>(context, node, parseSpectrumOrColour,
                     "one or three numbers, or pairs of wavelength:value, rising");
}

Rgb readPoint(const ReadContext& context, pugi::xml_node node) {
  checkAttributes(context, node, {"name", "x", "y", "z", "value"});
  return readVector(context, node, 0).cast<float>().array();
}

/// nullopt: not an element that holds a value.
std::optional<ParameterValue> readValue(ReadContext& context, pugi::xml_node node) {
  const std::string_view tag = node.name();
  if (tag == "float") return parsed<double>(context, node, parseNumber, "a number");
  if (tag == "integer") return static_cast<double>(parsed<int>(context, node, parseInteger, "an integer"));
  if (tag == "boolean") return parsed<bool>(context, node, parseBoolean, "true or false");
  if (tag == "string") return text(context, node);
  if (std::ranges::find(kColours, tag) != kColours.end()) return readColour(context, node, tag);
  if (tag == "point" || tag == "vector") return readPoint(context, node);
  if (tag == "transform") return readTransform(context, node);
  return std::nullopt;
}

void setValue(const ReadContext& context, pugi::xml_node node, ParameterValue value, Parameters& parameters) {
  const pugi::xml_attribute name = node.attribute("name");
  if (!name) context.file.fail(node, fmt::format("<{}> needs a name", node.name()));
  const std::string key = normalisedName(name.value());
  if (parameters.contains(key))
    context.file.fail(node, fmt::format("the parameter \"{}\" is given twice", name.value()));
  parameters.set(key, std::move(value), SceneFile::location(node));
}

}  // namespace

Parameters readParameters(ReadContext& context, pugi::xml_node node, const std::string& knownChildren,
                          const ChildHandler& onChild) {
  Parameters parameters;
  for (const pugi::xml_node child : node.children()) {
    rejectText(context, child);
    if (std::optional<ParameterValue> value = readValue(context, child)) {
      setValue(context, child, std::move(*value), parameters);
      continue;
    }
    const bool isReference = std::string_view(child.name()) == "ref";
    const pugi::xml_node target = isReference ? resolveReference(context, child) : child;
    if (onChild(target, child.attribute("name").value(), parameters)) continue;
    context.unsupported(
        child, fmt::format("<{}> in {}", target.name(), describe(node)),
        fmt::format("unknown element <{}> in {}; {}", target.name(), describe(node),
                    knownAre(target.name(),
                             fmt::format("{}{}{}", kValueElements, knownChildren.empty() ? "" : ", ", knownChildren))),
        "it is left out");
  }
  return parameters;
}

Parameters readParameters(ReadContext& context, pugi::xml_node node) {
  return readParameters(context, node, "", [](pugi::xml_node, const std::string&, Parameters&) { return false; });
}

void failAt(const ReadContext& context, pugi::xml_node node, const Parameters& parameters,
            const ParameterError& error) {
  const std::ptrdiff_t location = parameters.location(error.name);
  context.file.fail(location > 0 ? location : SceneFile::location(node),
                    fmt::format("{}: {}", describe(node), error.what()));
}

void checkUnused(ReadContext& context, pugi::xml_node node, const Parameters& parameters) {
  const std::string owner = describe(node);
  for (const std::string& name : parameters.unused()) {
    if (hasNoEffect(owner, name))
      context.note(fmt::format("{}: no effect of {}", owner, name));
    else
      context.unsupported(parameters.location(name), fmt::format("{} of {}", name, owner),
                          fmt::format("unknown parameter \"{}\" of {}; {}", name, owner,
                                      knownAre(name, fmt::format("{}", fmt::join(parameters.asked(), ", ")))),
                          "it is ignored");
  }
}

void noteUnused(ReadContext& context, pugi::xml_node node, const Parameters& parameters) {
  const std::vector<std::string> names = parameters.unused();
  if (!names.empty()) context.note(fmt::format("{}: no effect of {}", describe(node), fmt::join(names, ", ")));
}

void passOnRemarks(ReadContext& context, pugi::xml_node node, const Parameters& parameters) {
  for (const std::string& note : parameters.notes()) context.note(describe(node) + ": " + note);
  for (const auto& [name, text] : parameters.warnings()) {
    const std::ptrdiff_t location = parameters.location(name);
    context.warn(location > 0 ? location : SceneFile::location(node), describe(node) + ": " + text,
                 describe(node) + ": " + text);
  }
}

std::string requiredText(const Parameters& parameters, const std::string& name) {
  if (!parameters.has(name)) throw ParameterError("", fmt::format("the parameter \"{}\" is needed", name));
  return parameters.text(name, "");
}

Eigen::Matrix3f rotationOf(const Parameters& parameters, const char* name) {
  Eigen::Matrix3d m = parameters.transform(name).topLeftCorner<3, 3>();
  m /= std::cbrt(std::abs(m.determinant()));
  // Negated, so that it holds for a singular matrix (NaN).
  if (!((m.transpose() * m).isIdentity(1e-3)))
    throw ParameterError(name, fmt::format("{} of an environment must be a rotation", name));
  return m.cast<float>();
}

Eigen::Matrix4f toWorld(const Parameters& parameters) {
  return parameters.transform("to_world").cast<float>();
}

}  // namespace lobe
