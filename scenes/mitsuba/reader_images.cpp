#include "scenes/mitsuba/reader_images.h"

#include <algorithm>
#include <cctype>
#include <exception>
#include <new>

#include <fmt/format.h>

#include "runtime/core/parallel.h"
#include "scenes/mitsuba/reader_parameters.h"
#include "scenes/mitsuba/values.h"

namespace lobe {
namespace {

bool namesImage(pugi::xml_node node, bool environment) {
  const std::string_view type = node.attribute("type").value();
  return (elementName(node) == "texture" && type == "bitmap") ||
         (environment && elementName(node) == "emitter" && type == "envmap");
}

/// The image request from those parameters that are valid; faults are reported later, when the element is read.
std::optional<ImageRequest> peek(const ReadContext& context, pugi::xml_node node, bool linear) {
  Parameters parameters;
  for (const pugi::xml_node child : node.children()) {
    const std::string name = normalisedName(child.attribute("name").value());
    const char* value = child.attribute("value").value();
    if (name == "filename" || name == "channel") parameters.set(name, std::string(value), SceneFile::location(child));
    if (const std::optional<bool> raw = parseBoolean(value); raw && name == "raw") parameters.set(name, *raw);
    if (const std::optional<double> gamma = parseNumber(value); gamma && name == "gamma") parameters.set(name, *gamma);
  }
  if (linear) parameters.set("raw", true);
  try {
    return elementName(node) == "texture" ? bitmapRequest(context, parameters) : imageRequest(context, parameters);
  } catch (const ParameterError&) {
    return std::nullopt;
  }
}

bool isNormalMap(pugi::xml_node node) {
  return elementName(node) == "bsdf" && std::string_view(node.attribute("type").value()) == "normalmap";
}

/// linear: the node's images are linear, whatever encoding they state.
void collect(const ReadContext& context, pugi::xml_node node, bool linear, std::vector<ImageRequest>& requests) {
  if (namesImage(node, context.options.geometry))
    if (const std::optional<ImageRequest> request = peek(context, node, linear)) requests.push_back(*request);
  for (const pugi::xml_node child : node.children())
    collect(context, child, elementName(child) == "texture" && (linear || isNormalMap(node)), requests);
}

Encoding encodingOf(const ReadContext& context, const Parameters& parameters) {
  const bool raw = parameters.flag("raw", false);
  const double gamma = parameters.number("gamma", -1.0);
  if (gamma != -1.0 && !(gamma >= 0.0))
    throw ParameterError("gamma",
                         "gamma must be positive, or -1 for sRGB, or 0 for the encoding that the image file states");
  if (raw || gamma == 1.0) return {Encoding::Kind::linear, 1.0f};
  if (gamma == 0.0 || (!parameters.has("gamma") && !context.file.isOfToday())) return {Encoding::Kind::tagged, 1.0f};
  if (gamma == -1.0) return {Encoding::Kind::srgb, 1.0f};
  return {Encoding::Kind::gamma, static_cast<float>(gamma)};
}

}  // namespace

ImageRequest imageRequest(const ReadContext& context, const Parameters& parameters) {
  return {context.file.resolve(requiredText(parameters, "filename"), parameters.location("filename")),
          encodingOf(context, parameters)};
}

ImageRequest bitmapRequest(const ReadContext& context, const Parameters& parameters) {
  ImageRequest request = imageRequest(context, parameters);
  request.alpha = channelOf(parameters) == "a";
  return request;
}

std::string channelOf(const Parameters& parameters) {
  std::string channel = parameters.text("channel", "");
  std::ranges::transform(channel, channel.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return channel;
}

std::shared_ptr<const Image> withoutFaults(ReadContext& context, pugi::xml_node node, const ImageRequest& request,
                                           std::shared_ptr<const Image> image, Sign sign) {
  const auto isFaulty = [sign](const Rgb& p) { return !p.allFinite() || (sign == Sign::positive && (p < 0.0f).any()); };
  const auto count = std::ranges::count_if(image->pixels, isFaulty);
  if (count == 0) return image;
  context.note(fmt::format("{}: {}: {} of {} pixels are {}not finite and are replaced by black", describe(node),
                           request.path.string(), count, image->pixels.size(),
                           sign == Sign::positive ? "negative or " : ""));
  auto sound = std::make_shared<Image>(*image);
  std::ranges::replace_if(sound->pixels, isFaulty, Rgb::Zero());
  return sound;
}

ImageStore::ImageStore(const ReadContext& context) {
  std::vector<ImageRequest> requests;
  collect(context, context.file.scene(), false, requests);
  std::vector<std::pair<ImageRequest, Entry*>> reads;
  for (const ImageRequest& request : requests)
    if (const auto [entry, isNew] = entries_.try_emplace(keyOf(request)); isNew)
      reads.emplace_back(request, &entry->second);
  parallelFor(std::size_t{0}, reads.size(), [&](std::size_t i) { *reads[i].second = read(reads[i].first); });
}

ImageStore::Key ImageStore::keyOf(const ImageRequest& request) {
  return {request.path, request.encoding.kind, request.encoding.exponent, request.alpha};
}

ImageStore::Entry ImageStore::read(const ImageRequest& request) {
  try {
    Image image = request.alpha ? readAlpha(request.path) : readImage(request.path, request.encoding);
    return {std::make_shared<const Image>(std::move(image)), ""};
  } catch (const std::bad_alloc&) {
    throw;  // no fault of the file, so lenient reading must not go on without it
  } catch (const std::exception& error) {
    return {nullptr, error.what()};
  }
}

std::shared_ptr<const Image> ImageStore::get(ReadContext& context, pugi::xml_node node, const Parameters& parameters,
                                             const ImageRequest& request, const std::string& remedy) {
  const auto [entry, isNew] = entries_.try_emplace(keyOf(request));
  if (isNew) entry->second = read(request);
  if (entry->second.image) return entry->second.image;
  const std::ptrdiff_t location = parameters.location("filename");
  const std::string message = fmt::format("{}: {}", describe(node), entry->second.fault);
  if (std::filesystem::exists(request.path)) context.file.fail(location, message);
  context.unsupported(location, "missing image " + request.path.string(), message, remedy);
  return nullptr;
}

}  // namespace lobe
