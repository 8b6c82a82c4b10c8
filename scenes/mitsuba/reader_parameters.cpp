#include "scenes/mitsuba/reader_parameters.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/LU>

#include "scenes/mitsuba/reader_colours.h"
#include "scenes/mitsuba/reader_values.h"
#include "scenes/mitsuba/values.h"
#include "scenes/scene_scale.h"

namespace lobe {
namespace {

constexpr std::string_view kValueElements =
    "float, integer, boolean, string, rgb, srgb, xyz, spectrum, blackbody, point, vector, transform";

/// Mitsuba parameters that do not change the converged picture: storage and acceleration, settings of other
/// integrators, output files that are not written, and motion, which is not supported. An element without a type stands
/// for all its types.
constexpr std::pair<std::string_view, std::string_view> kWithoutEffect[] = {
    {"texture \"bitmap\"", "accel, cache, format, max_anisotropy"},
    {"emitter \"constant\"", "to_world"},
    {"emitter \"envmap\"", "cache, mis_compensation"},
    {"film",
     "attach_log, banner, channel_names, component_format, compression, digits, file_format, filename, has_alpha, "
     "high_quality_edges, sample_border, variable"},
    {"integrator",
     "aovs, block_size, bsdf_samples, emitter_samples, rr_depth, samples_per_pass, shading_samples, "
     "strict_normals, timeout"},
    {"sensor", "shutter_close, shutter_open"},
    {"shape \"ply\"", "srgb"},
};

bool hasNoEffect(const std::string& owner, std::string_view name) {
  const std::string_view tag = std::string_view(owner).substr(0, owner.find(' '));
  for (const auto& [element, names] : kWithoutEffect)
    if (element == owner || element == tag)
      if (fmt::format(", {}, ", names).find(fmt::format(", {}, ", name)) != std::string::npos) return true;
  return false;
}

Rgb readPoint(const ReadContext& context, pugi::xml_node node) {
  checkAttributes(context, node, {"name", "x", "y", "z", "value"});
  return readVector(context, node, 0).cast<float>().array();
}

/// nullopt for an element that does not hold a value.
std::optional<ParameterValue> readValue(ReadContext& context, pugi::xml_node node) {
  const std::string_view tag = node.name();
  if (tag == "float") return parsedValue<double>(context, node, parseNumber, "a number");
  if (tag == "integer") return static_cast<double>(parsedValue<int>(context, node, parseInteger, "an integer"));
  if (tag == "boolean") return parsedValue<bool>(context, node, parseBoolean, "true or false");
  if (tag == "string") return valueText(context, node);
  if (const std::optional<Rgb> colour = readColour(context, node)) return *colour;
  if (tag == "point" || tag == "vector") return readPoint(context, node);
  if (tag == "transform") return readTransform(context, node);
  return std::nullopt;
}

void setValue(ReadContext& context, pugi::xml_node node, ParameterValue value, Parameters& parameters) {
  const pugi::xml_attribute name = node.attribute("name");
  if (!name) context.file.fail(node, fmt::format("<{}> needs a name", node.name()));
  const std::string key = normalisedName(name.value());
  if (parameters.contains(key)) warnOfRepetition(context, node, name.value());
  parameters.set(key, std::move(value), SceneFile::location(node));
}

}  // namespace

void warnOfRepetition(ReadContext& context, pugi::xml_node node, const std::string& name) {
  const std::string message = fmt::format("the parameter \"{}\" is given twice: the last one is used", name);
  context.warn(SceneFile::location(node), message, message);
}

Parameters readParameters(ReadContext& context, pugi::xml_node node, const std::string& knownChildren,
                          const ChildHandler& onChild) {
  Parameters parameters;
  const auto read = [&](pugi::xml_node child) {
    if (SceneFile::hasUndefinedName(child)) return parameters.markIncomplete();
    rejectText(context, child);
    if (std::optional<ParameterValue> value = readValue(context, child))
      return setValue(context, child, std::move(*value), parameters);
    const bool isReference = std::string_view(child.name()) == "ref";
    const pugi::xml_node target = isReference ? resolveReference(context, child) : child;
    if (onChild(target, child.attribute("name").value(), parameters)) return;
    context.unsupported(
        child, fmt::format("<{}> in {}", target.name(), describe(node)),
        fmt::format("unknown element <{}> in {}; {}", target.name(), describe(node),
                    knownAre(target.name(),
                             fmt::format("{}{}{}", kValueElements, knownChildren.empty() ? "" : ", ", knownChildren))),
        fmt::format("<{}> is left out", target.name()));
  };
  for (const pugi::xml_node child : node.children())
    if (!context.attempt(fmt::format("{} is ignored", nameOf(child)), [&] { read(child); }))
      parameters.markIncomplete();
  return parameters;
}

Parameters readParameters(ReadContext& context, pugi::xml_node node) {
  return readParameters(context, node, "", [](pugi::xml_node, const std::string&, Parameters&) { return false; });
}

void failUnlessIncomplete(const ReadContext& context, pugi::xml_node node, const Parameters& parameters,
                          std::string_view message) {
  if (parameters.isIncomplete()) throw SceneError(std::vector<Fault>());
  context.file.fail(node, message);
}

void RefusedParameters::erase(ReadContext& context, pugi::xml_node node, Parameters& parameters,
                              const ParameterError& error) {
  const std::string message = fmt::format("{}: {}", describe(node), error.what());
  if (parameters.contains(error.name)) {
    all_.push_back({error.name, message, parameters.location(error.name)});
    parameters.erase(error.name);
    return;
  }
  if (all_.empty()) failUnlessIncomplete(context, node, parameters, message);
  const Refused last = std::move(all_.back());
  all_.pop_back();
  report(context);
  context.file.fail(last.location, last.message);
}

void RefusedParameters::report(ReadContext& context) const {
  for (const Refused& refused : all_)
    context.unsupported(refused.location, refused.message, refused.message, fmt::format("{} is ignored", refused.name));
}

void checkUnused(ReadContext& context, pugi::xml_node node, const Parameters& parameters) {
  const std::string owner = describe(node);
  for (const std::string& name : parameters.unused()) {
    const std::ptrdiff_t location = parameters.location(name);
    const std::string kind = fmt::format("{} of {}", name, owner);
    const std::string known = knownAre(name, fmt::format("{}", fmt::join(parameters.asked(), ", ")));
    const std::string message = fmt::format("unknown parameter \"{}\" of {}; {}", name, owner, known);
    if (hasNoEffect(owner, name))
      context.findings.noteWithoutEffect(owner, name);
    else if (context.file.isOfToday())
      context.unsupported(location, kind, message, fmt::format("{} is ignored", name));
    else
      context.warn(location, kind, message + ": it is ignored");
  }
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
  // Negated, so that it also rejects a singular matrix (NaN).
  if (!((m.transpose() * m).isIdentity(1e-3)))
    throw ParameterError(name, fmt::format("{} of an environment must be a rotation", name));
  return m.cast<float>();
}

Eigen::Matrix4f toWorld(const Parameters& parameters) {
  return parameters.transform("to_world").cast<float>();
}

void requireInRange(const Vec3& position, const char* name) {
  if (!isInRange(position))
    throw ParameterError(name, fmt::format("the position is {:g}, {:g}, {:g}: coordinates over {:g} are not supported",
                                           position.x(), position.y(), position.z(), kLargestCoordinate));
}

Eigen::Matrix4f placeInWorld(const Parameters& parameters) {
  Eigen::Matrix4f placed = toWorld(parameters);
  requireInRange(placed.topRightCorner<3, 1>(), "to_world");
  return placed;
}

}  // namespace lobe
