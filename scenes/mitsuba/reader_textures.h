#pragma once
// Texture elements of scene files.

#include <map>
#include <utility>

#include "scenes/mitsuba/reader_images.h"

namespace lobe {

/// How the values of a texture's images are interpreted: with the encoding that the scene or the image states, as
/// colours (asGiven) or as values of either sign (asGivenSigned), or as linear values of either sign (linear).
enum class Encoded { asGiven, asGivenSigned, linear };

/// A limit of the textures nested in an element, and of its BSDFs and textures together, counted as often as they are
/// evaluated.
inline constexpr int kMostParts = 1000;

class TextureReader {
 public:
  explicit TextureReader(ReadContext& context) : context_(context), images_(context) {}

  /// bitmap, checkerboard, scale or a spectrum; each element is read once for each encoding. Throws SceneError.
  TexturePtr read(pugi::xml_node node, Encoded encoded = Encoded::asGiven);
  /// A texture that repeats the image in the file, for images that are not given by a texture element. node: the
  /// element that messages name. location: where the file is named.
  TexturePtr readFile(pugi::xml_node node, std::ptrdiff_t location, const std::filesystem::path& path, Encoded encoded);
  ImageStore& images() { return images_; }
  /// This texture, which must have been read, and those nested in it, counted as often as they are evaluated.
  int partsOf(pugi::xml_node node, Encoded encoded) const {
    return done_.at({SceneFile::location(node), encoded}).parts;
  }

  /// Sets the parameter if the child is a texture. Has the return value of a ChildHandler.
  bool take(pugi::xml_node child, const std::string& name, Parameters& parameters, Encoded encoded = Encoded::asGiven);

 private:
  struct Made {
    TexturePtr texture;  ///< null while being read
    int parts = 1;       ///< see partsOf
  };
  TexturePtr makeOf(pugi::xml_node node, Encoded encoded);
  TexturePtr makeFromBitmap(pugi::xml_node node, const Parameters& parameters, Encoded encoded);

  ReadContext& context_;
  ImageStore images_;
  std::map<std::pair<std::ptrdiff_t, Encoded>, Made> done_;  // by location
  int parts_ = 0;                                            // read so far for the element that is being read
  int depth_ = 0;                                            // of the texture being read
};

}  // namespace lobe
