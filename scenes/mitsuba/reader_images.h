#pragma once
// The images of a scene: each file is read once, all at once by all cores.

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "materials/parameters.h"
#include "runtime/image/image.h"
#include "scenes/mitsuba/read_context.h"

namespace lobe {

/// The file of an image and how its numbers are meant.
struct ImageRequest {
  std::filesystem::path path;
  Encoding encoding;
  bool alpha = false;  ///< of its alpha channel alone
};

/// From the parameters filename, raw and gamma (1 is linear, −1 sRGB, 0 what the file says) of an environment map. In
/// files for Mitsuba 0.6, 0 is what there is without a gamma.
ImageRequest imageRequest(const ReadContext& context, const Parameters& parameters);

/// The same for a bitmap, which may have a channel, too.
ImageRequest bitmapRequest(const ReadContext& context, const Parameters& parameters);

/// The parameter channel in small letters; empty when there is none.
std::string channelOf(const Parameters& parameters);

/// What an image's numbers may be.
enum class Sign { positive, any };

/// The image with black for pixels that are not finite or not of this sign, and a note when there are any.
std::shared_ptr<const Image> withoutFaults(ReadContext& context, pugi::xml_node node, const ImageRequest& request,
                                           std::shared_ptr<const Image> image, Sign sign);

class ImageStore {
 public:
  /// Reads every image the file's bitmaps (and environment maps, where geometry is wanted) name, in parallel. Faults
  /// are kept until the image is asked for.
  explicit ImageStore(const ReadContext& context);

  /// nullptr when the file is missing and that is tolerated. SceneError at the filename parameter.
  std::shared_ptr<const Image> get(ReadContext& context, pugi::xml_node node, const Parameters& parameters,
                                   const ImageRequest& request, const std::string& remedy);

 private:
  using Key = std::tuple<std::filesystem::path, Encoding::Kind, float, bool>;
  struct Entry {
    std::shared_ptr<const Image> image;
    std::string fault;
  };
  static Key keyOf(const ImageRequest& request);
  static Entry read(const ImageRequest& request);

  std::map<Key, Entry> entries_;
};

}  // namespace lobe
