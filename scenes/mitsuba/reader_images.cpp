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

/// Throws ParameterError if there is no such channel.
void checkChannel(const std::string& channel) {
  constexpr std::string_view kChannels = "rgbay";
  if (channel.size() > 1 || kChannels.find(channel) == std::string_view::npos)
    throw ParameterError("channel", fmt::format("unknown channel \"{}\"; known are r, g, b, a, y", channel));
}

bool isFaulty(const Rgb& pixel, Sign sign) {
  return !pixel.allFinite() || (sign == Sign::positive && (pixel < 0.0f).any());
}

/// Whether there are faulty pixels; adds a note with their number.
bool findFaulty(ReadContext& context, pugi::xml_node node, const ImageRequest& request, const Image& image, Sign sign) {
  const auto count = std::ranges::count_if(image.pixels, [sign](const Rgb& p) { return isFaulty(p, sign); });
  if (count > 0)
    context.note(fmt::format("{}: {}: {} of {} pixels are {}not finite and are replaced by black", describe(node),
                             request.path.string(), count, image.pixels.size(),
                             sign == Sign::positive ? "negative or " : ""));
  return count > 0;
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
  if (!findFaulty(context, node, request, *image, sign)) return image;
  auto sound = std::make_shared<Image>(*image);
  std::ranges::replace_if(
      sound->pixels, [sign](const Rgb& p) { return isFaulty(p, sign); }, Rgb::Zero());
  return sound;
}

ImageStore::ImageStore(const ReadContext& context) {
  std::vector<ImageRequest> requests;
  collect(context, context.file.scene(), false, requests);
  std::vector<std::pair<ImageRequest, Entry*>> reads;
  for (const ImageRequest& request : requests)
    if (const auto [entry, isNew] = entries_.try_emplace(keyOf(request)); isNew) {
      reads.emplace_back(request, &entry->second);
      budget_.addFile(request.path);
    }
  parallelFor(std::size_t{0}, reads.size(), [&](std::size_t i) { *reads[i].second = read(reads[i].first); });
  if (!budget_.isExceeded()) return;
  // Which images have been read depends on the order of the threads.
  for (const auto& [request, entry] : reads)
    if (pathExists(request.path)) *entry = {nullptr, budget_.fault()};
}

ImageStore::Key ImageStore::keyOf(const ImageRequest& request) {
  return {request.path, request.encoding.kind, request.encoding.exponent, request.alpha};
}

ImageStore::Entry ImageStore::read(const ImageRequest& request) {
  // It would not be used. That a file is missing is another fault.
  if (budget_.isExceeded() && pathExists(request.path)) return {nullptr, budget_.fault()};
  try {
    Image image = request.alpha ? readAlpha(request.path) : readImage(request.path, request.encoding);
    budget_.addImage(image.pixels.size());
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
  if (isNew) {
    budget_.addFile(request.path);
    entry->second = read(request);
  }
  if (entry->second.image) return entry->second.image;
  const std::ptrdiff_t location = parameters.location("filename");
  const std::string message = fmt::format("{}: {}", describe(node), entry->second.fault);
  if (pathExists(request.path)) context.file.fail(location, message);
  context.unsupported(location, "missing image " + request.path.string(), message, remedy);
  return nullptr;
}

std::shared_ptr<const Image> ImageStore::prepared(ReadContext& context, pugi::xml_node node,
                                                  const Parameters& parameters, const ImageRequest& request,
                                                  const std::shared_ptr<const Image>& image, Sign sign) {
  const std::string channel = channelOf(parameters);
  checkChannel(channel);
  const std::tuple key(image.get(), channel, sign);
  auto known = prepared_.find(key);
  if (known == prepared_.end())
    known = prepared_.emplace(key, prepare(context, node, request, channel, image, sign)).first;
  if (const auto* result = std::get_if<std::shared_ptr<const Image>>(&known->second)) return *result;
  const auto& fault = std::get<ParameterError>(known->second);
  if (fault.name == "channel") throw ParameterError(fault);
  context.file.fail(parameters.location("filename"), fmt::format("{}: {}", describe(node), fault.what()));
}

ImageStore::Prepared ImageStore::prepare(ReadContext& context, pugi::xml_node node, const ImageRequest& request,
                                         const std::string& channel, const std::shared_ptr<const Image>& image,
                                         Sign sign) {
  const bool hasFaulty = findFaulty(context, node, request, *image, sign);
  const auto isGrey = [sign](const Rgb& p) { return isFaulty(p, sign) || (p == p.x()).all(); };
  if (channel == "y" && !std::ranges::all_of(image->pixels, isGrey))
    return ParameterError("channel", "only grey images have a channel y; this one has r, g, b");
  // For alpha, the image has been read from the alpha channel.
  const bool selects = channel == "r" || channel == "g" || channel == "b";
  if (!hasFaulty && !selects) return image;
  try {
    budget_.addImage(image->pixels.size());
  } catch (const std::runtime_error& error) {
    return ParameterError("filename", error.what());
  }
  auto copy = std::make_shared<Image>(*image);
  const Eigen::Index component = channel == "r" ? 0 : channel == "g" ? 1 : 2;
  for (Rgb& pixel : copy->pixels) {
    if (isFaulty(pixel, sign)) pixel = Rgb::Zero();
    if (selects) pixel = grey(pixel[component]);
  }
  return copy;
}

}  // namespace lobe
