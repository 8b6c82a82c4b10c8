#pragma once
// The images of a scene. Each file is read once, and all files are read in parallel.

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <variant>
#include <vector>

#include "materials/parameters.h"
#include "runtime/image/image.h"
#include "runtime/image/image_limits.h"
#include "scenes/mitsuba/read_context.h"

namespace lobe {

/// The file of an image and the encoding of its values.
struct ImageRequest {
  std::filesystem::path path;
  Encoding encoding;
  bool alpha = false;  ///< read only its alpha channel
};

/// From the parameters filename, raw and gamma of an environment map. gamma: 1 is linear, −1 is sRGB, 0 is the encoding
/// stated by the image file. The default is 0 in files for Mitsuba 0.6, and −1 in newer ones.
ImageRequest imageRequest(const ReadContext& context, const Parameters& parameters);

/// The same for a bitmap, which may also have a channel.
ImageRequest bitmapRequest(const ReadContext& context, const Parameters& parameters);

/// The parameter channel in lower case; empty when there is none.
std::string channelOf(const Parameters& parameters);

/// The sign that the values of an image may have.
enum class Sign { positive, any };

/// The image with black in place of pixels that are not finite or do not have this sign; adds a note when there are
/// any.
std::shared_ptr<const Image> withoutFaults(ReadContext& context, pugi::xml_node node, const ImageRequest& request,
                                           std::shared_ptr<const Image> image, Sign sign);

/// The number of pixels of all its images is limited. No further image is read once they are over the limit.
class ImageStore {
 public:
  /// Reads the images of all the file's bitmaps (and environment maps, if geometry is read) in parallel. Errors are
  /// kept until the image is requested.
  explicit ImageStore(const ReadContext& context);

  /// Returns nullptr, after reporting a fault with `remedy` as its consequence, when the file does not exist. Throws
  /// SceneError at the filename parameter when it cannot be read.
  std::shared_ptr<const Image> get(ReadContext& context, pugi::xml_node node, const Parameters& parameters,
                                   const ImageRequest& request, const std::string& remedy);
  /// An image made from one that get() has returned: with black in place of faulty pixels (withoutFaults), and grey if
  /// a channel is selected. Elements that need the same image share it, or the fault that prevents it. Throws
  /// SceneError like get(), and ParameterError if there is no such channel.
  std::shared_ptr<const Image> prepared(ReadContext& context, pugi::xml_node node, const Parameters& parameters,
                                        const ImageRequest& request, const std::shared_ptr<const Image>& image,
                                        Sign sign);

 private:
  using Key = std::tuple<std::filesystem::path, Encoding::Kind, float, bool>;
  struct Entry {
    std::shared_ptr<const Image> image;
    std::string fault;
  };
  /// The fault names the parameter that causes it.
  using Prepared = std::variant<std::shared_ptr<const Image>, ParameterError>;
  static Key keyOf(const ImageRequest& request);
  Entry read(const ImageRequest& request);
  Prepared prepare(ReadContext& context, pugi::xml_node node, const ImageRequest& request, const std::string& channel,
                   const std::shared_ptr<const Image>& image, Sign sign);

  std::map<Key, Entry> entries_;
  std::map<std::tuple<const Image*, std::string, Sign>, Prepared> prepared_;  // by image and channel
  PixelBudget budget_;
};

}  // namespace lobe
