#include "scenes/mitsuba/reader_emitters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "scenes/camera.h"
#include "scenes/mitsuba/emission.h"
#include "scenes/mitsuba/reader_parameters.h"
#include "scenes/mitsuba/reader_sensor.h"
#include "scenes/mitsuba/values.h"

namespace lobe {
namespace {

Environment makeConstant(const Parameters& parameters) {
  const auto scale = static_cast<float>(emissionScale(parameters, "scale", 1.0));
  const Rgb radiance = emission(parameters, "radiance", grey(1.0f)) * scale;
  checkEmission("scale", "radiance times scale", radiance);
  return {Image(1, 1, radiance)};
}

std::optional<Environment> makeFromImage(ReadContext& context, TextureReader& textures, pugi::xml_node node,
                                         const Parameters& parameters) {
  Environment environment;
  environment.toWorld = rotationOf(parameters, "to_world");
  const auto scale = static_cast<float>(emissionScale(parameters, "scale", 1.0));
  const ImageRequest request = imageRequest(context, parameters);
  if (!context.options.geometry) return std::nullopt;
  const std::shared_ptr<const Image> image =
      textures.images().get(context, node, parameters, request, "the emitter is left out");
  if (!image) return std::nullopt;
  environment.radiance = *withoutFaults(context, node, request, image, Sign::positive);
  for (Rgb& pixel : environment.radiance.pixels) pixel *= scale;
  if (std::ranges::any_of(environment.radiance.pixels, [](const Rgb& p) { return !(p <= kLargestEmission).all(); }))
    throw ParameterError("filename", fmt::format("the image has pixels over {:g}", kLargestEmission));
  return environment;
}

Vec3 readPosition(const Parameters& parameters) {
  if (!parameters.has("position")) return placeInWorld(parameters).topRightCorner<3, 1>();
  if (parameters.has("to_world")) throw ParameterError("to_world", "give either position or to_world");
  Vec3 position = parameters.colour("position", Rgb::Zero()).matrix();
  requireInRange(position, "position");
  return position;
}

/// The world-space direction of +z of the emitter's frame.
Vec3 readAxis(const Parameters& parameters, const Vec3& axis) {
  const Eigen::Vector3d wide = axis.cast<double>();  // its square may exceed the range of floats
  if (!(wide.norm() > 0.0))
    throw ParameterError(parameters.has("direction") ? "direction" : "to_world", "the light's direction is zero");
  return wide.normalized().cast<float>();
}

PointLight makePoint(const Parameters& parameters) {
  return {readPosition(parameters), emission(parameters, "intensity", grey(1.0f))};
}

/// The texture that a light in this frame projects: u grows by perX along the frame's x at distance 1, v by perY along
/// y.
ProjectedTexture makeProjected(TexturePtr texture, const Eigen::Matrix4f& frame, double perX, double perY) {
  const Vec3 x = frame.block<3, 1>(0, 0).normalized(), y = frame.block<3, 1>(0, 1).normalized();
  // Negated, so that it also rejects NaN.
  if (!(x.norm() > 0.0f && y.norm() > 0.0f))
    throw ParameterError("to_world", "the transform of a light with a texture must not be singular");
  return {std::move(texture), x * static_cast<float>(perX), y * static_cast<float>(perY)};
}

constexpr double kDegree = std::numbers::pi / 180.0;

/// The texture fills the square around the cone. cutoff: in degrees. intensity: with which it is multiplied.
std::optional<ProjectedTexture> makeSpotTexture(const Parameters& parameters, const Eigen::Matrix4f& frame,
                                                double cutoff, const Rgb& intensity) {
  if (!parameters.has("texture")) return std::nullopt;
  if (!(cutoff < 90.0))
    throw ParameterError("texture", fmt::format("a texture needs a cutoff_angle below 90 degrees, not {}", cutoff));
  TexturePtr texture = emissionTexture(parameters, "texture", grey(1.0f));
  checkEmission("texture", "intensity times texture", intensity * texture->largest());
  const double perUnit = 0.5 / std::tan(cutoff * kDegree);
  return makeProjected(std::move(texture), frame, perUnit, perUnit);
}

SpotLight makeSpot(const Parameters& parameters) {
  const Eigen::Matrix4f frame = placeInWorld(parameters);
  const double cutoff = parameters.number("cutoff_angle", 20.0);
  if (!(cutoff > 0.0 && cutoff <= 180.0))
    throw ParameterError("cutoff_angle",
                         fmt::format("cutoff_angle must be over 0 and at most 180 degrees, not {}", cutoff));
  const double beam = parameters.number("beam_width", 0.75 * cutoff);
  if (!(beam >= 0.0 && beam <= cutoff))
    throw ParameterError("beam_width",
                         fmt::format("beam_width must be between 0 and the cutoff_angle, {}, not {}", cutoff, beam));
  const Rgb intensity = emission(parameters, "intensity", grey(1.0f));
  return {frame.topRightCorner<3, 1>(),
          readAxis(parameters, frame.block<3, 1>(0, 2)),
          intensity,
          static_cast<float>(cutoff * kDegree),
          static_cast<float>(beam * kDegree),
          makeSpotTexture(parameters, frame, cutoff, intensity)};
}

/// Oriented like the view of a camera: the first pixel of the image is at +x and +y.
ProjectorLight makeProjector(const Parameters& parameters) {
  if (!parameters.has("irradiance")) throw ParameterError("", "the parameter \"irradiance\" is needed");
  TexturePtr irradiance = emissionTexture(parameters, "irradiance", grey(1.0f));
  const auto scale = static_cast<float>(emissionScale(parameters, "scale", 1.0));
  checkEmission("scale", "irradiance times scale", irradiance->largest() * scale);
  const auto [width, height] = irradiance->resolution();
  Camera camera;
  readFieldOfView(parameters, camera);
  const double tangent = std::tan(0.5 * horizontalFov(camera, width, height) * kDegree);
  const Eigen::Matrix4f frame = toWorld(parameters);
  const double perX = -0.5 / tangent, perY = perX * width / height;
  return {frame.topRightCorner<3, 1>(), readAxis(parameters, frame.block<3, 1>(0, 2)), scale,
          makeProjected(std::move(irradiance), frame, perX, perY)};
}

DirectionalLight makeDirectional(const Parameters& parameters) {
  if (parameters.has("direction") && parameters.has("to_world"))
    throw ParameterError("to_world", "give either direction or to_world");
  const Vec3 axis = parameters.has("direction") ? Vec3(parameters.colour("direction", Rgb::Zero()).matrix())
                                                : Vec3(toWorld(parameters).block<3, 1>(0, 2));
  return {readAxis(parameters, axis), emission(parameters, "irradiance", grey(1.0f))};
}

DeltaLight makeDelta(const std::string& type, const Parameters& parameters) {
  if (type == "point") return makePoint(parameters);
  if (type == "projector") return makeProjector(parameters);
  if (type == "spot") return makeSpot(parameters);
  return makeDirectional(parameters);
}

constexpr std::array<std::string_view, 4> kDeltaTypes = {"directional", "point", "projector", "spot"};
constexpr std::array<std::string_view, 10> kTypes = {"area",      "constant", "directional", "envmap", "point",
                                                     "projector", "sky",      "spot",        "sun",    "sunsky"};

}  // namespace

void EmitterReader::add(pugi::xml_node node) {
  const std::string type = typeOf(context_, node);
  if (type == "area") {
    if (node.attribute("id")) return;  // for shapes to refer to
    context_.file.fail(node, "an area emitter must be inside a shape, or have an id for shapes to refer to");
  }
  if (std::ranges::find(kTypes, type) == kTypes.end()) {
    context_.unsupported(node, "emitter " + type,
                         fmt::format("unknown emitter type \"{}\"; {}", type,
                                     knownAre(type, fmt::format("{}", fmt::join(kTypes, ", ")))),
                         "the emitter is left out");
    return;
  }
  const Parameters parameters = readParameters(
      context_, node, "texture",
      [this](pugi::xml_node child, const std::string& name, Parameters& p) { return textures_.take(child, name, p); });
  if (std::ranges::find(kDeltaTypes, type) != kDeltaTypes.end())
    addDelta(node, parameters, type);
  else
    addDistant(node, parameters, type);
}

void EmitterReader::addDelta(pugi::xml_node node, const Parameters& parameters, const std::string& type) {
  double weight = 1.0;
  const DeltaLight light = makeFrom(context_, node, parameters, [&](const Parameters& p) {
    weight = readSamplingWeight(context_, node, p);
    if (weight == 0.0)
      p.warn("sampling_weight", "a light with a sampling_weight of 0 is never sampled: it is left out");
    return makeDelta(type, p);
  });
  if (context_.options.geometry && weight > 0.0) context_.scene.lights.push_back(light);
}

void EmitterReader::addDistant(pugi::xml_node node, const Parameters& parameters, const std::string& type) {
  const bool daylight = DaylightReader::knows(type);
  if (environment_ || (daylight_.any() && !daylight))
    context_.file.fail(
        node, "a second environment: only one constant or envmap, or any number of sky, sun and sunsky, is supported");
  if (daylight) return daylight_.add(node, parameters, type);
  environment_ = true;
  std::optional<Environment> environment = makeFrom(context_, node, parameters, [&](const Parameters& p) {
    readSamplingWeight(context_, node, p);
    return type == "constant" ? makeConstant(p) : makeFromImage(context_, textures_, node, p);
  });
  if (context_.options.geometry && environment) context_.scene.environment = std::move(environment);
}

}  // namespace lobe
