#include "scenes/reader_emitters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "scenes/emission.h"
#include "scenes/reader_parameters.h"
#include "scenes/values.h"

namespace lobe {
namespace {

Environment makeConstant(const Parameters& parameters) {
  const auto scale = static_cast<float>(emissionScale(parameters, "scale", 1.0));
  return {Image(1, 1, emission(parameters, "radiance", grey(1.0f)) * scale)};
}

std::optional<Environment> makeFromImage(ReadContext& context, TextureReader& textures, pugi::xml_node node,
                                         const Parameters& parameters) {
  Environment environment;
  environment.toWorld = rotationOf(parameters, "to_world");
  const auto scale = static_cast<float>(emissionScale(parameters, "scale", 1.0));
  imageRequest(context, parameters);  // checks and uses its parameters, whether or not the image is wanted
  if (!context.options.geometry) return std::nullopt;
  const std::shared_ptr<const Image> image =
      textures.images().get(context, node, parameters, "the emitter is left out");
  if (!image) return std::nullopt;
  environment.radiance = *withoutFaults(context, node, parameters, image, Sign::positive);
  for (Rgb& pixel : environment.radiance.pixels) pixel *= scale;
  if (std::ranges::any_of(environment.radiance.pixels, [](const Rgb& p) { return !(p <= kLargestEmission).all(); }))
    throw ParameterError("filename", fmt::format("the image has pixels over {:g}", kLargestEmission));
  return environment;
}

Vec3 readPosition(const Parameters& parameters) {
  if (!parameters.has("position")) return placeInWorld(parameters).topRightCorner<3, 1>();
  if (parameters.has("to_world")) throw ParameterError("to_world", "give either position or to_world");
  const Vec3 position = parameters.colour("position", Rgb::Zero()).matrix();
  requireInRange(position, "position");
  return position;
}

/// Where +z of the emitter's frame points to.
Vec3 readAxis(const Parameters& parameters, const Vec3& axis) {
  const Eigen::Vector3d wide = axis.cast<double>();  // its square may be no float
  if (!(wide.norm() > 0.0))
    throw ParameterError(parameters.has("direction") ? "direction" : "to_world", "the light's direction is zero");
  return wide.normalized().cast<float>();
}

PointLight makePoint(const Parameters& parameters) {
  return {readPosition(parameters), emission(parameters, "intensity", grey(1.0f))};
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
  constexpr double kDegree = std::numbers::pi / 180.0;
  return {frame.topRightCorner<3, 1>(), readAxis(parameters, frame.block<3, 1>(0, 2)),
          emission(parameters, "intensity", grey(1.0f)), static_cast<float>(cutoff * kDegree),
          static_cast<float>(beam * kDegree)};
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
  if (type == "spot") return makeSpot(parameters);
  return makeDirectional(parameters);
}

constexpr std::array<std::string_view, 3> kDeltaTypes = {"directional", "point", "spot"};
constexpr std::array<std::string_view, 9> kTypes = {"area", "constant", "directional", "envmap", "point",
                                                    "sky",  "spot",     "sun",         "sunsky"};

Parameters readEmitterParameters(ReadContext& context, pugi::xml_node node, const std::string& type) {
  const auto refuseTexture = [&](pugi::xml_node child, const std::string&, Parameters&) {
    if (type != "spot" || elementName(child) != "texture") return false;
    context.unsupported(child, "texture of a spot", "a spot's texture is not supported: it shines evenly",
                        "the texture is left out");
    return true;
  };
  Parameters parameters = readParameters(context, node, "", refuseTexture);
  noteSamplingWeight(context, node, parameters);
  return parameters;
}

}  // namespace

void EmitterReader::add(pugi::xml_node node) {
  const std::string type = typeOf(context_, node);
  if (type == "area") {
    if (node.attribute("id")) return;  // for shapes to refer to
    context_.file.fail(node, "an area emitter must stand inside a shape, or have an id for shapes to refer to");
  }
  if (std::ranges::find(kTypes, type) == kTypes.end()) {
    context_.unsupported(node, "emitter " + type,
                         fmt::format("unknown emitter type \"{}\"; {}", type,
                                     knownAre(type, fmt::format("{}", fmt::join(kTypes, ", ")))),
                         "the emitter is left out");
    return;
  }
  const Parameters parameters = readEmitterParameters(context_, node, type);
  if (std::ranges::find(kDeltaTypes, type) != kDeltaTypes.end())
    addDelta(node, parameters, type);
  else
    addDistant(node, parameters, type);
}

void EmitterReader::addDelta(pugi::xml_node node, const Parameters& parameters, const std::string& type) {
  const DeltaLight light =
      makeFrom(context_, node, parameters, [&](const Parameters& p) { return makeDelta(type, p); });
  if (context_.options.geometry) context_.scene.lights.push_back(light);
}

void EmitterReader::addDistant(pugi::xml_node node, const Parameters& parameters, const std::string& type) {
  const bool daylight = DaylightReader::knows(type);
  if (environment_ || (daylight_.any() && !daylight))
    context_.file.fail(
        node, "a second environment: there may be one constant or envmap, or any number of sky, sun and sunsky");
  if (daylight) return daylight_.add(node, parameters, type);
  environment_ = true;
  std::optional<Environment> environment = makeFrom(context_, node, parameters, [&](const Parameters& p) {
    return type == "constant" ? makeConstant(p) : makeFromImage(context_, textures_, node, p);
  });
  if (context_.options.geometry && environment) context_.scene.environment = std::move(environment);
}

}  // namespace lobe
