#include "scenes/mitsuba/reader_sensor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/LU>

#include "scenes/camera.h"
#include "scenes/mitsuba/reader_parameters.h"
#include "scenes/mitsuba/values.h"
#include "scenes/scene_scale.h"

namespace lobe {
namespace {

constexpr std::array<std::string_view, 5> kAxes = {"x", "y", "diagonal", "smaller", "larger"};

/// Mitsuba's default when a film has no filter.
constexpr PixelFilter kDefaultFilter{PixelFilter::Kind::gaussian, 2.0f, 0.5f};

constexpr std::array<std::string_view, 6> kFilters = {"box", "catmullrom", "gaussian", "lanczos", "mitchell", "tent"};

// Limits that no camera reaches, but within which rays are finite.
constexpr double kLargestRadius = 100, kSmallestRadius = 1e-6;  // of filters, in pixels
constexpr double kLargestCoefficient = 100;                     // of filters
constexpr double kLargestOffset = 1e4;                          // of the principal point, in sizes of the film
constexpr double kNarrowestView = 1e-6;                         // degrees
constexpr double kLargestAperture = 1e6;                        // radius, in focus distances
constexpr double kSmallestLength = 1e-35;                       // in the world

/// A number from -limit to limit.
float boundedNumber(const Parameters& parameters, const char* name, double fallback, double limit) {
  const double value = parameters.number(name, fallback);
  if (!(std::abs(value) <= limit))
    throw ParameterError(name, fmt::format("{} must be from {} to {}, not {}", name, -limit, limit, value));
  return static_cast<float>(value);
}

/// Parameters as in Mitsuba, whose Gaussian extends four standard deviations to each side.
PixelFilter makeFilter(const std::string& type, const Parameters& parameters) {
  const auto number = [&](const char* name, double fallback, double largest = kLargestRadius) {
    const double value = parameters.number(name, fallback);
    if (!(value >= kSmallestRadius && value <= largest))
      throw ParameterError(name,
                           fmt::format("{} must be from {} to {}, not {}", name, kSmallestRadius, largest, value));
    return static_cast<float>(value);
  };
  if (type == "box") return {PixelFilter::Kind::box, number("radius", 0.5), 0.5f};
  if (type == "tent") return {PixelFilter::Kind::tent, number("radius", 1.0), 0.5f};
  if (type == "catmullrom") return {PixelFilter::Kind::mitchell, 2.0f, 0.5f, 0.0f, 0.5f};
  if (type == "lanczos") return {PixelFilter::Kind::lanczos, number("lobes", 3.0)};
  if (type == "mitchell") {
    const auto coefficient = [&](const char* name) {
      return boundedNumber(parameters, name, 1.0 / 3.0, kLargestCoefficient);
    };
    // Mitsuba 3's manual calls them A and B; its code, like that of 0.6, reads B and C. Both are accepted.
    const bool new3 = parameters.has("a");
    return {PixelFilter::Kind::mitchell, number("radius", 2.0), 0.5f, coefficient(new3 ? "a" : "b"),
            coefficient(new3 ? "b" : "c")};
  }
  const float stddev = number("stddev", 0.5, kLargestRadius / 4);
  return {PixelFilter::Kind::gaussian, 4.0f * stddev, stddev};
}

void readFilter(ReadContext& context, pugi::xml_node node) {
  const std::string type = typeOf(context, node);
  if (std::ranges::find(kFilters, type) == kFilters.end()) {
    context.unsupported(node, "rfilter " + type,
                        fmt::format("unknown rfilter type \"{}\"; {}", type,
                                    knownAre(type, fmt::format("{}", fmt::join(kFilters, ", ")))),
                        "a Gaussian filter is used");
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

struct FilmSize {
  int width, height;
  std::optional<FilmCrop> crop;
};

void checkPicture(int width, int height) {
  if (std::int64_t{width} * height > kMaxPicturePixels)
    throw ParameterError("width", fmt::format("a picture of {}x{} pixels is too large: at most {} pixels are supported",
                                              width, height, kMaxPicturePixels));
}

std::optional<FilmCrop> readCrop(const Parameters& parameters, int filmWidth, int filmHeight) {
  if (std::ranges::none_of(kCropParameters, [&](const char* name) { return parameters.has(name); })) return {};
  FilmCrop crop;
  crop.x = readPixels(parameters, "crop_offset_x", 0, 0, filmWidth - 1);
  crop.y = readPixels(parameters, "crop_offset_y", 0, 0, filmHeight - 1);
  crop.width = readPixels(parameters, "crop_width", filmWidth - crop.x, 1, filmWidth - crop.x);
  crop.height = readPixels(parameters, "crop_height", filmHeight - crop.y, 1, filmHeight - crop.y);
  return crop;
}

FilmSize readSize(const Parameters& parameters, const Camera& camera) {
  FilmSize size;
  size.width = readPixels(parameters, "width", camera.width, 1, kMaxPictureSide);
  size.height = readPixels(parameters, "height", camera.height, 1, kMaxPictureSide);
  size.crop = readCrop(parameters, size.width, size.height);
  checkPicture(size.crop ? size.crop->width : size.width, size.crop ? size.crop->height : size.height);
  return size;
}

/// Notes parameters of the film that tone-map or convert the picture. They are not applied: EXR files hold linear
/// radiance, PNG files are sRGB-encoded.
void noteDevelopment(ReadContext& context, pugi::xml_node node, Parameters& parameters) {
  constexpr std::array<const char*, 6> kNames = {"burn", "exposure", "gamma", "key", "pixel_format", "tonemap_method"};
  for (const char* name : kNames) {
    if (!parameters.contains(name)) continue;
    const bool isRgb = parameters.holdsText(name) && parameters.text(name, "").starts_with("rgb");
    if (!isRgb)
      context.note(fmt::format("{}: {} is not applied: pictures hold linear RGB radiance", describe(node), name));
    parameters.erase(name);
  }
}

void readFilm(ReadContext& context, pugi::xml_node node) {
  const auto onChild = [&](pugi::xml_node child, const std::string&, Parameters&) {
    if (elementName(child) != "rfilter") return false;
    readFilter(context, child);
    return true;
  };
  Parameters parameters = readParameters(context, node, "rfilter", onChild);
  noteDevelopment(context, node, parameters);
  Camera& camera = context.scene.camera;
  const FilmSize size = makeFrom(context, node, parameters, [&](const Parameters& p) { return readSize(p, camera); });
  camera.width = size.width;
  camera.height = size.height;
  camera.crop = size.crop;
}

void noteSampler(ReadContext& context, pugi::xml_node node) {
  context.note(
      fmt::format("sampler \"{}\" is ignored: loberender uses its own, see --spp", node.attribute("type").value()));
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

}  // namespace

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

namespace {

/// Throws ParameterError unless rays can be transformed to the world.
void checkFrame(const Camera& camera) {
  const Eigen::Matrix3d frame = camera.toWorld.topLeftCorner<3, 3>().cast<double>();
  if (!(frame.array().abs() <= kLargestCoordinate).all())
    throw ParameterError("to_world", fmt::format("a camera's scale must not be over {:g}", kLargestCoordinate));
  if (frame.determinant() == 0) throw ParameterError("to_world", "a camera's transform must not be singular");
  if (frame.cwiseAbs().maxCoeff() < kSmallestLength)
    throw ParameterError("to_world", fmt::format("a camera's scale must not be under {:g}", kSmallestLength));
}

/// A length along an axis of the camera's frame, in the world.
double inWorld(const Camera& camera, double length) {
  return length * camera.toWorld.topLeftCorner<3, 3>().cast<double>().colwise().norm().maxCoeff();
}

/// Throws ParameterError with this name for a length that is too large.
void checkLength(const Camera& camera, double length, const char* name) {
  if (!(inWorld(camera, length) <= kLargestCoordinate))
    throw ParameterError(name, fmt::format("{} is {:g} in the world: lengths over {:g} are not supported", name,
                                           inWorld(camera, length), kLargestCoordinate));
}

void readLens(const Parameters& parameters, Camera& camera) {
  if (!parameters.has("aperture_radius")) throw ParameterError("", "the parameter \"aperture_radius\" is needed");
  camera.apertureRadius = static_cast<float>(parameters.number("aperture_radius", 0));
  if (!(camera.apertureRadius >= 0.0f))
    throw ParameterError("aperture_radius",
                         fmt::format("aperture_radius must not be negative, not {}", camera.apertureRadius));
  checkLength(camera, camera.apertureRadius, "aperture_radius");
  constexpr double kFar = 1e4;  // Mitsuba's default focus distance is far_clip
  camera.focusDistance = static_cast<float>(parameters.number("focus_distance", parameters.number("far_clip", kFar)));
  if (!(inWorld(camera, camera.focusDistance) >= kSmallestLength))
    throw ParameterError("focus_distance", fmt::format("focus_distance must be at least {:g} in the world, not {}",
                                                       kSmallestLength, camera.focusDistance));
  if (!(camera.apertureRadius <= kLargestAperture * camera.focusDistance))
    throw ParameterError("aperture_radius",
                         fmt::format("aperture_radius must be at most {:g} times focus_distance, {}, "
                                     "not {}",
                                     kLargestAperture, camera.focusDistance, camera.apertureRadius));
}

/// Distances along the viewing axis; a plane that the file does not give does not clip.
void readClipPlanes(const Parameters& parameters, Camera& camera) {
  camera.nearClip = static_cast<float>(parameters.number("near_clip", 0));
  camera.farClip = parameters.has("far_clip") ? static_cast<float>(parameters.number("far_clip", 0)) : camera.farClip;
  if (!(camera.nearClip >= 0.0f))
    throw ParameterError("near_clip", fmt::format("near_clip must not be negative, not {}", camera.nearClip));
  checkLength(camera, camera.nearClip, "near_clip");
  if (!(camera.farClip > camera.nearClip))
    throw ParameterError("far_clip",
                         fmt::format("far_clip must be over near_clip, {}, not {}", camera.nearClip, camera.farClip));
}

void readPerspective(const Parameters& parameters, Camera& camera) {
  readFieldOfView(parameters, camera);
  camera.horizontalFov = horizontalFov(camera, camera.width, camera.height);
  if (!(camera.horizontalFov >= kNarrowestView && camera.horizontalFov < 180.0f))
    throw ParameterError(parameters.has("fov") ? "fov" : "focal_length",
                         fmt::format("the horizontal field of view must be from {:g} to 180 degrees, not {}",
                                     kNarrowestView, camera.horizontalFov));
  camera.shift = Vec2(boundedNumber(parameters, "principal_point_offset_x", 0, kLargestOffset),
                      boundedNumber(parameters, "principal_point_offset_y", 0, kLargestOffset));
}

/// In the order of Camera::Kind.
constexpr std::array<std::string_view, 3> kCameras = {"perspective", "thinlens", "orthographic"};

/// Reads the camera; its film must have been read.
Camera readCamera(ReadContext& context, pugi::xml_node node, const Parameters& parameters, Camera::Kind kind) {
  Camera camera = context.scene.camera;
  camera.kind = kind;
  camera.toWorld = placeInWorld(parameters);
  checkFrame(camera);
  if (kind != Camera::Kind::orthographic) readPerspective(parameters, camera);
  if (kind == Camera::Kind::thinlens) readLens(parameters, camera);
  readClipPlanes(parameters, camera);
  // Only a thin lens has a focal plane.
  if (kind != Camera::Kind::thinlens && parameters.has("focus_distance")) {
    parameters.number("focus_distance", 0);
    context.findings.noteWithoutEffect(describe(node), "focus_distance");
  }
  return camera;
}

/// Integrators that compute something other than radiance.
constexpr std::array<std::string_view, 6> kNotRadiance = {"albedo", "ao", "depth", "field", "motion", "normal"};

/// Integrators whose parameters are known.
constexpr std::array<std::string_view, 5> kPathTracers = {"direct", "path", "volpath", "volpath_simple", "volpathmis"};

/// The parameters of an integrator that restrict the light transport.
struct LightTransport {
  std::optional<int> maxDepth;
  bool hideEmitters = false;
};

std::optional<int> readMaxDepth(const Parameters& parameters) {
  if (!parameters.has("max_depth")) return std::nullopt;
  const double depth = parameters.number("max_depth", -1);
  if (!(depth >= -1 && depth <= 1e9) || depth != std::floor(depth))
    throw ParameterError("max_depth",
                         fmt::format("max_depth must be an integer from 0, or -1 for no limit, not {}", depth));
  return depth < 0 ? std::nullopt : std::optional(static_cast<int>(depth));
}

LightTransport readTransport(const std::string& type, const Parameters& parameters) {
  LightTransport transport;
  transport.maxDepth = readMaxDepth(parameters);
  constexpr int kDirect = 2;  // segments
  if (type == "direct") transport.maxDepth = std::min(transport.maxDepth.value_or(kDirect), kDirect);
  transport.hideEmitters = parameters.flag("hide_emitters", false);
  if (parameters.has("strict_normals") && !parameters.flag("strict_normals", true))
    parameters.warn("strict_normals",
                    "strict normals are always on: directions on different sides of the surface and "
                    "of the plane orthogonal to the shading normal carry no light");
  return transport;
}

/// Parameters of unknown integrators are noted and erased, except those that are read here.
void keepTransport(ReadContext& context, pugi::xml_node node, Parameters& parameters) {
  for (const std::string& name : parameters.unused()) {
    if (name == "max_depth" || name == "hide_emitters" || name == "strict_normals") continue;
    context.findings.noteWithoutEffect(describe(node), name);
    parameters.erase(name);
  }
}

/// Reads an integrator and those that are nested in it.
class TransportReader {
 public:
  explicit TransportReader(ReadContext& context) : context_(context) {}

  /// The transport of the integrator or, if it contains another one, of the inner one.
  LightTransport read(pugi::xml_node node) {
    const Nesting nesting(context_, node, depth_);
    read_.insert(SceneFile::location(node));
    const std::string type = node.attribute("type").value();
    std::optional<LightTransport> nested;
    const auto onChild = [&](pugi::xml_node child, const std::string&, Parameters&) {
      if (elementName(child) == "integrator" && isNew(child)) nested = read(child);
      return true;  // other children only configure the integrator
    };
    if (std::ranges::find(kNotRadiance, type) != kNotRadiance.end())
      context_.unsupported(node, "integrator " + type, fmt::format("integrator \"{}\" does not compute radiance", type),
                           "radiance is rendered");
    Parameters parameters = readParameters(context_, node, "integrator", onChild);
    if (std::ranges::find(kPathTracers, type) == kPathTracers.end()) keepTransport(context_, node, parameters);
    const LightTransport own =
        makeFrom(context_, node, parameters, [&](const Parameters& p) { return readTransport(type, p); });
    return nested.value_or(own);
  }

 private:
  /// Reports a fault if the integrator has been read already: one that contains itself would be read without end, and
  /// by references to others that are contained twice, a small file could contain any number of them.
  bool isNew(pugi::xml_node node) {
    if (!read_.contains(SceneFile::location(node))) return true;
    context_.unsupported(node, fmt::format("circle at {}", SceneFile::location(node)),
                         "an integrator that contains itself, or that is contained twice", "it is left out there");
    return false;
  }

  ReadContext& context_;
  std::set<std::ptrdiff_t> read_;  // by location
  int depth_ = 0;                  // of the integrator being read
};

}  // namespace

void readSensor(ReadContext& context, pugi::xml_node node) {
  const std::string type = typeOf(context, node);
  const auto known = std::ranges::find(kCameras, type);
  if (known == kCameras.end())
    context.unsupported(node, "sensor " + type,
                        fmt::format("unknown sensor type \"{}\"; {}", type,
                                    knownAre(type, fmt::format("{}", fmt::join(kCameras, ", ")))),
                        "a perspective sensor is used");
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
      rejectMedium(context, child);
    return tag == "film" || tag == "sampler" || tag == "medium";
  };
  const Parameters parameters = readParameters(context, node, "film, sampler", onChild);
  context.scene.camera =
      makeFrom(context, node, parameters, [&](const Parameters& p) { return readCamera(context, node, p, kind); });
}

void readIntegrator(ReadContext& context, pugi::xml_node node) {
  const LightTransport transport = TransportReader(context).read(node);
  Scene& scene = context.scene;
  scene.maxDepth = transport.maxDepth;
  if (transport.hideEmitters)
    scene.emitterVisibility = context.file.isOfToday() ? EmitterVisibility::hidden : EmitterVisibility::dark;
  std::string kept;
  if (transport.maxDepth)
    kept += fmt::format("; its max_depth is kept: paths have up to {} segments unless --max-depth is given",
                        *transport.maxDepth);
  if (transport.hideEmitters) kept += "; its hide_emitters is kept";
  context.note(fmt::format("integrator \"{}\" is ignored: loberender uses its own, see --integrator{}",
                           node.attribute("type").value(), kept));
}

}  // namespace lobe
