#pragma once
// Writes images, and reads the attributes of image files.

#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "runtime/image/image.h"

namespace lobe {

/// The text of an attribute. It is a type of its own, because libstdc++ 12 assumes that a std::variant of std::string
/// always holds a value: if copying such a variant throws, a string that was never constructed is destroyed.
struct AttributeText : std::string {
  using std::string::string;
  AttributeText(std::string text) : std::string(std::move(text)) {}
};

/// Attributes of an image file by name. Equal images with equal attributes give identical files, so reproducible files
/// must not contain times.
using ImageAttributes = std::map<std::string, std::variant<AttributeText, double>>;

/// How pixels are stored in an .exr file.
struct ExrFormat {
  enum class Type { floats, halves } type = Type::floats;
  enum class Compression { none, rle, zips, zip, piz, dwaa, dwab } compression = Compression::zip;

  /// Whether colours are only approximate: DWA compression changes channels whose names end in R, G, B or Y.
  bool isLossy() const { return compression == Compression::dwaa || compression == Compression::dwab; }
};

/// The most and the least that the type half can store.
inline constexpr float kLargestHalf = 65504.0f;

/// The most and the least that is stored in colours with DWA compression, which converts them to halves, also if the
/// type is float. Beside dark pixels decoded values may be larger, by 3 % in our tests; halves must still hold them.
inline constexpr float kLargestDwa = 0.5f * kLargestHalf;

/// Channels of an .exr file besides the colours: `name.R`, `name.G` and `name.B`, for example. All channels of a file
/// have the same size.
struct ImageLayer {
  std::string name;
  std::string components;  ///< the last letters of the names of the channels: one or three
  Image image;             ///< with one component, it is in all channels
  bool precise = false;    ///< stored as floats whatever the format: depths, for which halves are too coarse
};

/// Throws std::runtime_error unless the name ends in .exr or .png. Called before rendering, so that a wrong name is
/// found early.
void checkImageName(const std::filesystem::path& path);

/// Whether the name ends in .exr.
bool isExrName(const std::filesystem::path& path);

/// Writes the file atomically. .exr: floating-point RGB and the layers, with the attributes; .png: 8-bit sRGB, clipped
/// to [0, 1], without attributes and layers. Returns the number of finite values that are too large for the format
/// and were replaced by kLargestHalf or, with DWA compression, kLargestDwa, or the negative of it. Throws
/// std::runtime_error that names the file.
std::size_t writeImage(const std::filesystem::path& path, const Image& image, const ImageAttributes& attributes = {},
                       std::span<const ImageLayer> layers = {}, const ExrFormat& format = {});

/// The attributes of type double and string of an .exr file; empty for other files. Throws std::runtime_error that
/// names the file.
ImageAttributes readAttributes(const std::filesystem::path& path);

/// Writes 8-bit RGB triples, row by row from the top, as a PNG. Throws like writeImage.
void writePng(const std::filesystem::path& path, int width, int height, const std::vector<std::uint8_t>& rgb);

}  // namespace lobe
