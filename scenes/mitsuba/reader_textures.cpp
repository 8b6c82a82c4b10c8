#include "scenes/mitsuba/reader_textures.h"

#include <algorithm>
#include <cctype>
#include <utility>

#include <fmt/format.h>

#include "materials/textures/bitmap.h"
#include "materials/textures/checkerboard.h"
#include "scenes/mitsuba/reader_colours.h"
#include "scenes/mitsuba/reader_parameters.h"
#include "scenes/mitsuba/values.h"

namespace lobe {
namespace {

/// Reflectance that replaces a texture that cannot be read.
constexpr float kFallbackGrey = 0.5f;

/// The transform of texture coordinates: Mitsuba 0.6's numbers, of which uvscale is for both axes, or Mitsuba 3's
/// to_uv.
UvMap readUvMap(const Parameters& parameters) {
  if (!parameters.has("to_uv")) {
    const auto number = [&](const char* name, double fallback) {
      return static_cast<float>(parameters.number(name, fallback));
    };
    const double both = parameters.number("uvscale", 1);
    return {Eigen::Matrix2f(Vec2(number("uscale", both), number("vscale", both)).asDiagonal()),
            Vec2(number("uoffset", 0), number("voffset", 0))};
  }
  const Eigen::Matrix4d m = parameters.transform("to_uv");
  // A matrix of 9 numbers has its translation in the third column, which is multiplied by the 1 of (u, v, 1).
  return {m.topLeftCorner<2, 2>().cast<float>(), (m.col(2) + m.col(3)).head<2>().cast<float>()};
}

Wrap parseWrap(const std::string& parameter, const std::string& mode) {
  if (mode == "repeat") return Wrap::repeat;
  if (mode == "mirror") return Wrap::mirror;
  if (mode == "clamp") return Wrap::clamp;
  if (mode == "zero" || mode == "black") return Wrap::zero;
  if (mode == "one" || mode == "white") return Wrap::one;
  throw ParameterError(parameter, fmt::format("unknown wrap mode \"{}\"; {}", mode,
                                              knownAre(mode, "repeat, mirror, clamp, zero, one, black, white")));
}

bool readNearest(const Parameters& parameters) {
  std::string filter = parameters.text("filter_type", "bilinear");
  std::ranges::transform(filter, filter.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const bool prefilters = filter == "trilinear" || filter == "ewa";
  if (filter != "nearest" && filter != "bilinear" && !prefilters)
    throw ParameterError("filter_type",
                         fmt::format("unknown filter \"{}\"; known are nearest, bilinear, trilinear, ewa", filter));
  // The samples of a pixel average what these filters average in advance.
  if (prefilters) parameters.note(fmt::format("filter_type {} is replaced by bilinear", filter));
  return filter == "nearest";
}

BitmapOptions readBitmapOptions(const Parameters& parameters) {
  BitmapOptions options;
  const std::string both = parameters.text("wrap_mode", "repeat");
  options.wrapU = parseWrap("wrap_mode", both);
  options.wrapV = options.wrapU;
  if (parameters.has("wrap_mode_u")) options.wrapU = parseWrap("wrap_mode_u", parameters.text("wrap_mode_u", ""));
  if (parameters.has("wrap_mode_v")) options.wrapV = parseWrap("wrap_mode_v", parameters.text("wrap_mode_v", ""));
  options.nearest = readNearest(parameters);
  options.uvMap = readUvMap(parameters);
  return options;
}

TexturePtr makeCheckerboardFrom(const ReadContext& context, const Parameters& parameters) {
  const NumberSquares numbers = context.file.isOfToday() ? NumberSquares::exchanged : NumberSquares::asColours;
  return makeCheckerboard(parameters.texture("color0", grey(0.4f)), parameters.texture("color1", grey(0.2f)),
                          readUvMap(parameters), numbers);
}

TexturePtr makeScaled(const Parameters& parameters) {
  return scaledTexture(parameters.onlyTexture(), parameters.colour("scale", grey(1.0f)));
}

}  // namespace

TexturePtr TextureReader::read(pugi::xml_node node, Encoded encoded) {
  const auto [entry, isNew] = done_.try_emplace({SceneFile::location(node), encoded});
  Made& done = entry->second;
  if (isNew) {
    const int outer = std::exchange(parts_, 1);
    const auto make = [&] {
      const Nesting nesting(context_, node, depth_);
      done.texture = makeOf(node, encoded);
    };
    if (!context_.attempt("grey is used", make)) {
      done.texture = constantTexture(grey(kFallbackGrey));
      parts_ = 1;
    }
    done.parts = std::exchange(parts_, outer);
  } else if (!done.texture) {
    context_.unsupported(node, fmt::format("circle at {}", SceneFile::location(node)),
                         "a texture that refers to itself", "grey is used in it");
    return constantTexture(grey(kFallbackGrey));
  }
  parts_ = std::min(parts_ + done.parts, kMostParts + 1);  // a file can have more than an int counts
  return done.texture;
}

bool TextureReader::take(pugi::xml_node child, const std::string& name, Parameters& parameters, Encoded encoded) {
  if (elementName(child) != "texture") return false;
  const std::string key = name.empty() ? "texture" : normalisedName(name);
  if (parameters.contains(key)) warnOfRepetition(context_, child, key);
  parameters.set(key, read(child, encoded), SceneFile::location(child));
  return true;
}

TexturePtr TextureReader::readFile(pugi::xml_node node, std::ptrdiff_t location, const std::filesystem::path& path,
                                   Encoded encoded) {
  Parameters parameters;
  parameters.set("filename", path.string(), location);
  parameters.set("raw", encoded != Encoded::asGiven);
  return makeFromBitmap(node, parameters, encoded);
}

TexturePtr TextureReader::makeOf(pugi::xml_node node, Encoded encoded) {
  const std::string type = typeOf(context_, node);
  if (type != "bitmap" && type != "checkerboard" && type != "scale" && !isSpectrum(type)) {
    context_.unsupported(node, "texture " + type,
                         fmt::format("unknown texture type \"{}\"; {}", type,
                                     knownAre(type, "bitmap, checkerboard, scale, " + knownSpectra())),
                         "grey is used");
    return constantTexture(grey(kFallbackGrey));
  }
  Parameters parameters = readParameters(
      context_, node, "texture",
      [&](pugi::xml_node child, const std::string& name, Parameters& p) { return take(child, name, p, encoded); });
  // Computing means and bounds visits all of them.
  if (parts_ > kMostParts)
    context_.file.fail(node, fmt::format("{}: more than {} nested textures", describe(node), kMostParts));
  if (type == "bitmap" && encoded == Encoded::linear) parameters.set("raw", true, parameters.location("raw"));
  return makeFrom(context_, node, parameters, [&](const Parameters& p) {
    if (isSpectrum(type)) return makeSpectrum(context_, node, type, p);
    if (type == "checkerboard") return makeCheckerboardFrom(context_, p);
    return type == "scale" ? makeScaled(p) : makeFromBitmap(node, p, encoded);
  });
}

TexturePtr TextureReader::makeFromBitmap(pugi::xml_node node, const Parameters& parameters, Encoded encoded) {
  const BitmapOptions options = readBitmapOptions(parameters);
  const ImageRequest request = bitmapRequest(context_, parameters);
  const std::shared_ptr<const Image> image = images_.get(context_, node, parameters, request, "grey is used");
  if (!image) return constantTexture(grey(kFallbackGrey));
  const Sign sign = encoded == Encoded::asGiven ? Sign::positive : Sign::any;
  return makeBitmap(images_.prepared(context_, node, parameters, request, image, sign), options);
}

}  // namespace lobe
