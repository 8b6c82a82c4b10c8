#pragma once
// Internal to scenes/: Wavefront's material libraries (MTL).

#include <string>
#include <string_view>
#include <vector>

#include "runtime/core/vec.h"

namespace lobe {

/// The parameters of a material that Mitsuba 0.6 uses. File names are as written in the file, empty if not given.
struct MtlMaterial {
  std::string name;
  Rgb diffuse = Rgb::Zero();        ///< Kd, linear
  Rgb specular = Rgb::Zero();       ///< Ks, linear
  float exponent = 0;               ///< Ns
  float opacity = 1;                ///< d
  int illumination = 0;             ///< illum, the number of the model
  std::string diffuseFile;          ///< map_Kd
  std::string specularFile;         ///< map_Ks
  std::string bumpFile;             ///< bump
  std::string opacityFile;          ///< map_d
  std::vector<std::string> faults;  ///< statements that are not read as written, one line each
};

/// The materials in the order of the file. Other statements are ignored, as are those before the first `newmtl`. As in
/// Mitsuba 0.6, colours are sRGB-encoded, and if a parameter has both a number and a file, the later one is used.
/// Throws std::runtime_error with line number and text for malformed numbers.
std::vector<MtlMaterial> parseMtl(std::string_view text);

}  // namespace lobe
