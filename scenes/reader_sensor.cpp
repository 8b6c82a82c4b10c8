#include "scenes/reader_sensor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "scenes/camera.h"
#include "scenes/reader_parameters.h"
#include "scenes/values.h"

namespace lobe {
namespace {

constexpr std::array<std::string_view, 5> kAxes = {"x", "y", "diagonal", "smaller", "larger"};

/// Mitsuba's when a film names none.
constexpr PixelFilter kDefaultFilter{PixelFilter::Kind::gaussian, 2.0f, 0.5f};

/// Mitsuba spans the Gaussian over four standard deviations to each side.
PixelFilter makeFilter(const std::string& type, const Parameters& parameters) {
  const auto number = [&](const char* name, double fallback) {
    const double value = parameters.number(name, fallback);
    if (!(value > 0.0)) throw ParameterError(name, fmt::format("{} must be positive, not {}", name, value));
    return static_cast<float>(value);
  };
  if (type == "box") return {PixelFilter::Kind::box, number("radius", 0.5), 0.5f};
  if (type == "tent") return {PixelFilter::Kind::tent, number("radius", 1.0), 0.5f};
  const float stddev = number("stddev", 0.5);
  return {PixelFilter::Kind::gaussian, 4.0f * stddev, stddev};
}

void readFilter(ReadContext& context, pugi::xml_node node) {
  const std::string type = typeOf(context, node);
  if (type != "box" && type != "tent" && type != "gaussian") {
    context.note(fmt::format("rfilter \"{}\" is replaced by gaussian (known are box, tent, gaussian)", type));
    return;
  }
  const Parameters parameters = readParameters(context, node);
  context.scene.filter = makeFrom(context, node, parameters, [&](const Parameters& p) { return makeFilter(type, p); });
}

int readSide(const Parameters& parameters, const char* name, int fallback) {
  constexpr int kLargest = 1 << 16;
  const double value = parameters.number(name, fallback);
  if (!(value >= 1 && value <= kLargest) || value != std::floor(value))
    throw ParameterError(name, fmt::format("{} must be an integer from 1 to {}, not {}", name, kLargest, value));
  return static_cast<int>(value);
}

void readFilm(ReadContext& context, pugi::xml_node node) {
  const auto onChild = [&](pugi::xml_node child, const std::string&, Parameters&) {
    if (elementName(child) != "rfilter") return false;
    readFilter(context, child);
    return true;
  };
  const Parameters parameters = readParameters(context, node, "rfilter", onChild);
  Camera& camera = context.scene.camera;
  try {
    camera.width = readSide(parameters, "width", camera.width);
    camera.height = readSide(parameters, "height", camera.height);
  } catch (const ParameterError& error) {
    failAt(context, node, parameters, error);
  }
  noteUnused(context, node, parameters);
}

void noteSampler(ReadContext& context, pugi::xml_node node) {
  context.note(fmt::format("sampler \"{}\" is replaced by ours; samples are set on the command line",
                           node.attribute("type").value()));
}

/// "50mm" on a 36 mm × 24 mm film, as the angle over its diagonal.
float fieldOfViewOf(const std::string& focalLength) {
  std::string_view digits = focalLength;
  if (digits.ends_with("mm")) digits.remove_suffix(2);
  const std::optional<double> millimetres = parseNumber(digits);
  if (!millimetres || !(*millimetres > 0.0))
    throw ParameterError("focal_length", fmt::format("\"{}\" is not a length in mm such as 50mm", focalLength));
  return static_cast<float>(2.0 * std::atan(std::hypot(36.0, 24.0) / (2.0 * *millimetres)) * 180.0 / std::numbers::pi);
}

void readFieldOfView(const Parameters& parameters, Camera& camera) {
  if (!parameters.has("fov")) {
    camera.fov = fieldOfViewOf(parameters.text("focal_length", "50mm"));
    camera.fovAxis = "diagonal";
    if (parameters.has("fov_axis")) throw ParameterError("fov_axis", "fov_axis needs a fov");
    return;
  }
  if (parameters.has("focal_length")) throw ParameterError("focal_length", "give either fov or focal_length");
  camera.fov = static_cast<float>(parameters.number("fov", 0));
  if (!(camera.fov > 0.0f && camera.fov < 180.0f))
    throw ParameterError("fov", fmt::format("fov must be between 0 and 180 degrees, not {}", camera.fov));
  camera.fovAxis = parameters.text("fov_axis", "x");
  if (std::ranges::find(kAxes, camera.fovAxis) == kAxes.end())
    throw ParameterError("fov_axis",
                         fmt::format("unknown fov_axis \"{}\"; known are {}", camera.fovAxis, fmt::join(kAxes, ", ")));
}

bool readCamera(ReadContext& context, pugi::xml_node node, const Parameters& parameters) {
  Camera& camera = context.scene.camera;
  readFieldOfView(parameters, camera);
  camera.toWorld = toWorld(parameters);
  camera.horizontalFov = horizontalFov(camera, camera.width, camera.height);
  // A pinhole has everything in focus, and its rays start at the pinhole and never end.
  for (const char* name : {"near_clip", "far_clip", "focus_distance"})
    if (parameters.has(name)) {
      parameters.number(name, 0);
      context.note(fmt::format("{}: no effect of {}", describe(node), name));
    }
  return true;
}

std::optional<int> readMaxDepth(ReadContext& context, pugi::xml_node node) {
  for (const pugi::xml_node child : node.children()) {
    if (elementName(child) == "integrator")
      if (const std::optional<int> depth = readMaxDepth(context, child)) return depth;
    if (normalisedName(child.attribute("name").value()) != "max_depth") continue;
    const char* text = child.attribute("value").value();
    const std::optional<int> depth = parseInteger(text);
    if (!depth || *depth < -1)
      context.file.fail(child, fmt::format("max_depth must be an integer, or -1 for no limit, not \"{}\"", text));
    if (*depth >= 0) return depth;
  }
  return std::nullopt;
}

}  // namespace

void readSensor(ReadContext& context, pugi::xml_node node) {
  const std::string type = typeOf(context, node);
  if (type != "perspective")
    context.unsupported(node, "sensor " + type, fmt::format("unknown sensor type \"{}\"; known is perspective", type),
                        "it is taken for perspective");
  context.scene.filter = kDefaultFilter;
  const auto onChild = [&](pugi::xml_node child, const std::string&, Parameters&) {
    const std::string_view tag = elementName(child);
    if (tag == "film")
      readFilm(context, child);
    else if (tag == "sampler")
      noteSampler(context, child);
    else if (tag == "medium")
      noteMedium(context);
    return tag == "film" || tag == "sampler" || tag == "medium";
  };
  const Parameters parameters = readParameters(context, node, "film, sampler", onChild);
  makeFrom(context, node, parameters, [&](const Parameters& p) { return readCamera(context, node, p); });
}

void readIntegrator(ReadContext& context, pugi::xml_node node) {
  context.scene.maxDepth = readMaxDepth(context, node);
  context.note(fmt::format("integrator \"{}\" is replaced by ours{}", node.attribute("type").value(),
                           context.scene.maxDepth ? ", max_depth is kept" : ""));
}

}  // namespace lobe
