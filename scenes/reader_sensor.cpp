#include "scenes/reader_sensor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "scenes/camera.h"
#include "scenes/reader_parameters.h"
#include "scenes/values.h"

namespace lobe {
namespace {

constexpr std::array<std::string_view, 5> kAxes = {"x", "y", "diagonal", "smaller", "larger"};

/// Mitsuba's when a film names none.
constexpr PixelFilter kDefaultFilter{PixelFilter::Kind::gaussian, 2.0f, 0.5f};

constexpr std::array<std::string_view, 6> kFilters = {"box", "catmullrom", "gaussian", "lanczos", "mitchell", "tent"};

/// As Mitsuba has them: it spans the Gaussian over four standard deviations to each side.
PixelFilter makeFilter(const std::string& type, const Parameters& parameters) {
  const auto number = [&](const char* name, double fallback) {
    const double value = parameters.number(name, fallback);
    if (!(value > 0.0)) throw ParameterError(name, fmt::format("{} must be positive, not {}", name, value));
    return static_cast<float>(value);
  };
  if (type == "box") return {PixelFilter::Kind::box, number("radius", 0.5), 0.5f};
  if (type == "tent") return {PixelFilter::Kind::tent, number("radius", 1.0), 0.5f};
  if (type == "catmullrom") return {PixelFilter::Kind::mitchell, 2.0f, 0.5f, 0.0f, 0.5f};
  if (type == "lanczos") return {PixelFilter::Kind::lanczos, number("lobes", 3.0)};
  if (type == "mitchell") {
    const auto share = [&](const char* name) { return static_cast<float>(parameters.number(name, 1.0 / 3.0)); };
    // Mitsuba 3 calls them A and B, 0.6 B and C.
    const bool new3 = parameters.has("a");
    return {PixelFilter::Kind::mitchell, number("radius", 2.0), 0.5f, share(new3 ? "a" : "b"), share(new3 ? "b" : "c")};
  }
  const float stddev = number("stddev", 0.5);
  return {PixelFilter::Kind::gaussian, 4.0f * stddev, stddev};
}

void readFilter(ReadContext& context, pugi::xml_node node) {
  const std::string type = typeOf(context, node);
  if (std::ranges::find(kFilters, type) == kFilters.end()) {
    context.note(fmt::format("rfilter \"{}\" is replaced by gaussian (known are {})", type, fmt::join(kFilters, ", ")));
    return;
  }
  const Parameters parameters = readParameters(context, node);
  context.scene.filter = makeFrom(context, node, parameters, [&](const Parameters& p) { return makeFilter(type, p); });
}

int readPixels(const Parameters& parameters, const char* name, int fallback, int smallest, int largest) {
  const double value = parameters.number(name, fallback);
  if (!(value >= smallest && value <= largest) || value != std::floor(value))
    throw ParameterError(name,
                         fmt::format("{} must be an integer from {} to {}, not {}", name, smallest, largest, value));
  return static_cast<int>(value);
}

constexpr std::array<const char*, 4> kCropParameters = {"crop_offset_x", "crop_offset_y", "crop_width", "crop_height"};

void readSize(const Parameters& parameters, Camera& camera) {
  constexpr int kLargest = 1 << 16;
  camera.width = readPixels(parameters, "width", camera.width, 1, kLargest);
  camera.height = readPixels(parameters, "height", camera.height, 1, kLargest);
  if (std::ranges::none_of(kCropParameters, [&](const char* name) { return parameters.has(name); })) return;
  FilmCrop crop;
  crop.x = readPixels(parameters, "crop_offset_x", 0, 0, camera.width - 1);
  crop.y = readPixels(parameters, "crop_offset_y", 0, 0, camera.height - 1);
  crop.width = readPixels(parameters, "crop_width", camera.width - crop.x, 1, camera.width - crop.x);
  crop.height = readPixels(parameters, "crop_height", camera.height - crop.y, 1, camera.height - crop.y);
  camera.crop = crop;
}

void readFilm(ReadContext& context, pugi::xml_node node) {
  const auto onChild = [&](pugi::xml_node child, const std::string&, Parameters&) {
    if (elementName(child) != "rfilter") return false;
    readFilter(context, child);
    return true;
  };
  const Parameters parameters = readParameters(context, node, "rfilter", onChild);
  try {
    readSize(parameters, context.scene.camera);
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

void readLens(const Parameters& parameters, Camera& camera) {
  if (!parameters.has("aperture_radius")) throw ParameterError("", "the parameter \"aperture_radius\" is needed");
  camera.apertureRadius = static_cast<float>(parameters.number("aperture_radius", 0));
  if (!(camera.apertureRadius >= 0.0f))
    throw ParameterError("aperture_radius",
                         fmt::format("aperture_radius must not be negative, not {}", camera.apertureRadius));
  constexpr double kFar = 1e4;  // Mitsuba's far_clip is where it focuses unless told otherwise
  camera.focusDistance = static_cast<float>(parameters.number("focus_distance", parameters.number("far_clip", kFar)));
  if (!(camera.focusDistance > 0.0f))
    throw ParameterError("focus_distance",
                         fmt::format("focus_distance must be positive, not {}", camera.focusDistance));
}

void readPerspective(const Parameters& parameters, Camera& camera) {
  readFieldOfView(parameters, camera);
  camera.horizontalFov = horizontalFov(camera, camera.width, camera.height);
  camera.shift = Vec2(static_cast<float>(parameters.number("principal_point_offset_x", 0)),
                      static_cast<float>(parameters.number("principal_point_offset_y", 0)));
}

/// In the order of Camera::Kind.
constexpr std::array<std::string_view, 3> kCameras = {"perspective", "thinlens", "orthographic"};

bool readCamera(ReadContext& context, pugi::xml_node node, const Parameters& parameters, Camera::Kind kind) {
  Camera& camera = context.scene.camera;
  camera.kind = kind;
  camera.toWorld = toWorld(parameters);
  if (kind != Camera::Kind::orthographic) readPerspective(parameters, camera);
  if (kind == Camera::Kind::thinlens) readLens(parameters, camera);
  // Rays start at the pinhole, lens or film and never end, and but for a lens everything is in focus.
  const bool lens = kind == Camera::Kind::thinlens;
  for (const std::string name : {"near_clip", "far_clip", "focus_distance"})
    if (parameters.has(name) && !(lens && name == (parameters.has("focus_distance") ? "focus_distance" : "far_clip"))) {
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
  const auto known = std::ranges::find(kCameras, type);
  if (known == kCameras.end())
    context.unsupported(node, "sensor " + type,
                        fmt::format("unknown sensor type \"{}\"; {}", type,
                                    knownAre(type, fmt::format("{}", fmt::join(kCameras, ", ")))),
                        "it is taken for perspective");
  const auto kind =
      known == kCameras.end() ? Camera::Kind::perspective : static_cast<Camera::Kind>(known - kCameras.begin());
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
  makeFrom(context, node, parameters, [&](const Parameters& p) { return readCamera(context, node, p, kind); });
}

void readIntegrator(ReadContext& context, pugi::xml_node node) {
  context.scene.maxDepth = readMaxDepth(context, node);
  context.note(fmt::format("integrator \"{}\" is replaced by ours{}", node.attribute("type").value(),
                           context.scene.maxDepth ? ", max_depth is kept" : ""));
}

}  // namespace lobe
