#include "scenes/reader_environment.h"

#include <cmath>

#include <fmt/format.h>

#include "scenes/reader_parameters.h"

namespace lobe {
namespace {

/// The rotation in to_world; a uniform scale and a translation do not matter infinitely far away.
Eigen::Matrix3f readRotation(const Parameters& parameters) {
  Eigen::Matrix3d m = parameters.transform("to_world").topLeftCorner<3, 3>();
  m /= std::cbrt(std::abs(m.determinant()));
  // Negated, so that it holds for a singular matrix (NaN).
  if (!((m.transpose() * m).isIdentity(1e-3)))
    throw ParameterError("to_world", "to_world of an environment must be a rotation");
  return m.cast<float>();
}

Environment makeConstant(const Parameters& parameters) {
  return {Image(1, 1, parameters.colour("radiance", grey(1.0f)))};
}

std::optional<Environment> makeFromImage(ReadContext& context, TextureReader& textures, pugi::xml_node node,
                                         const Parameters& parameters) {
  Environment environment;
  environment.toWorld = readRotation(parameters);
  const auto scale = static_cast<float>(parameters.number("scale", 1.0));
  imageRequest(context, parameters);  // checks and uses its parameters, whether or not the image is wanted
  if (!context.options.geometry) return std::nullopt;
  const std::shared_ptr<const Image> image = textures.images().get(context, node, parameters, "it is left out");
  if (!image) return std::nullopt;
  environment.radiance = *image;
  for (Rgb& pixel : environment.radiance.pixels) pixel *= scale;
  return environment;
}

}  // namespace

void readEnvironment(ReadContext& context, TextureReader& textures, pugi::xml_node node) {
  const std::string type = typeOf(context, node);
  if (type == "area") context.file.fail(node, "an area emitter must stand inside a shape");
  if (type != "constant" && type != "envmap") {
    context.unsupported(node, "emitter " + type,
                        fmt::format("unknown emitter type \"{}\"; known are area, constant, envmap", type),
                        "it is left out");
    return;
  }
  const Parameters parameters = readParameters(context, node);
  std::optional<Environment> environment = makeFrom(context, node, parameters, [&](const Parameters& p) {
    return type == "constant" ? makeConstant(p) : makeFromImage(context, textures, node, p);
  });
  if (context.scene.environment) context.file.fail(node, "a second environment: there may be one constant or envmap");
  if (context.options.geometry && environment) context.scene.environment = std::move(environment);
}

}  // namespace lobe
