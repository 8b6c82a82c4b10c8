#pragma once
// Texture elements of scene files.

#include <map>

#include "scenes/reader_images.h"

namespace lobe {

class TextureReader {
 public:
  explicit TextureReader(ReadContext& context) : context_(context), images_(context) {}

  /// bitmap, checkerboard or scale; each element is read once. Throws SceneError.
  TexturePtr read(pugi::xml_node node);
  ImageStore& images() { return images_; }

  /// Sets the parameter if the child is a texture, as a ChildHandler does.
  bool take(pugi::xml_node child, const std::string& name, Parameters& parameters);

 private:
  TexturePtr make(pugi::xml_node node);
  TexturePtr makeFromBitmap(pugi::xml_node node, const Parameters& parameters);

  ReadContext& context_;
  ImageStore images_;
  std::map<std::ptrdiff_t, TexturePtr> done_;  // by place; null while being read
};

}  // namespace lobe
