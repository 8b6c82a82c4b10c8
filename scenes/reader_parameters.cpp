#include "scenes/reader_parameters.h"

#include <cmath>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/LU>

#include "scenes/transforms.h"
#include "scenes/values.h"

namespace lobe {
namespace {

constexpr std::string_view kValueElements =
    "float, integer, boolean, string, rgb, srgb, spectrum, point, vector, transform";

std::string text(const ReadContext& context, pugi::xml_node node) {
  checkAttributes(context, node, {"name", "value"});
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

Rgb readColour(const ReadContext& context, pugi::xml_node node, std::string_view tag) {
  if (tag == "srgb") return parsed<Rgb>(context, node, parseSrgb, "one or three numbers or #rrggbb");
  if (tag == "spectrum") return parsed<Rgb>(context, node, parseColour, "one or three numbers; no other spectra");
  return parsed<Rgb>(context, node, parseColour, "one or three numbers");
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
  if (tag == "rgb" || tag == "srgb" || tag == "color" || tag == "spectrum") return readColour(context, node, tag);
  if (tag == "point" || tag == "vector") return readPoint(context, node);
  if (tag == "transform") return readTransform(context, node);
  return std::nullopt;
}

void setValue(const ReadContext& context, pugi::xml_node node, ParameterValue value, Parameters& parameters) {
  const pugi::xml_attribute name = node.attribute("name");
  if (!name) context.file.fail(node, fmt::format("<{}> needs a name", node.name()));
  const std::string key = normalisedName(name.value());
  if (parameters.has(key)) context.file.fail(node, fmt::format("the parameter \"{}\" is given twice", name.value()));
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
    context.unsupported(child, fmt::format("<{}> in {}", target.name(), describe(node)),
                        fmt::format("unknown element <{}> in {}; known are {}{}{}", target.name(), describe(node),
                                    kValueElements, knownChildren.empty() ? "" : ", ", knownChildren),
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
  for (const std::string& name : parameters.unused())
    context.unsupported(parameters.location(name), fmt::format("{} of {}", name, describe(node)),
                        fmt::format("unknown parameter \"{}\" of {}; known are {}", name, describe(node),
                                    fmt::join(parameters.asked(), ", ")),
                        "it is ignored");
}

void noteUnused(ReadContext& context, pugi::xml_node node, const Parameters& parameters) {
  const std::vector<std::string> names = parameters.unused();
  if (!names.empty()) context.note(fmt::format("{}: no effect of {}", describe(node), fmt::join(names, ", ")));
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
