#pragma once
// Texture elements of scene files.

#include <map>
#include <utility>

#include "scenes/mitsuba/reader_images.h"

namespace lobe {

/// Whether a texture's images are encoded as they or the file say, and hold colours or any numbers, or are plain
/// numbers of either sign whatever is said.
enum class Encoded { asGiven, asGivenSigned, linear };

class TextureReader {
 public:
  explicit TextureReader(ReadContext& context) : context_(context), images_(context) {}

  /// bitmap, checkerboard, scale or a spectrum; each element is read once for each encoding. Throws SceneError.
  TexturePtr read(pugi::xml_node node, Encoded encoded = Encoded::asGiven);
  /// The image in the file, repeated over all texture coordinates, for what names it other than by a texture element.
  /// The node is that of which messages speak, the location where it names the file.
  TexturePtr readFile(pugi::xml_node node, std::ptrdiff_t location, const std::filesystem::path& path, Encoded encoded);
  ImageStore& images() { return images_; }

  /// Sets the parameter if the child is a texture, as a ChildHandler does.
  bool take(pugi::xml_node child, const std::string& name, Parameters& parameters, Encoded encoded = Encoded::asGiven);

 private:
  struct Made {
    TexturePtr texture;  ///< null while being read
    int parts = 1;       ///< this texture and, as often as they are asked, those nested in it
  };
  TexturePtr makeOf(pugi::xml_node node, Encoded encoded);
  TexturePtr makeFromBitmap(pugi::xml_node node, const Parameters& parameters, Encoded encoded);

  ReadContext& context_;
  ImageStore images_;
  std::map<std::pair<std::ptrdiff_t, Encoded>, Made> done_;  // by place
  int parts_ = 0;                                            // read so far for the element that is being read
  int depth_ = 0;                                            // of the texture being read
};

}  // namespace lobe
