#pragma once
// Internal to scenes/: Wavefront's material libraries (MTL).

#include <string>
#include <string_view>
#include <vector>

#include "runtime/core/vec.h"

namespace lobe {

/// What Mitsuba 0.6 takes of a material; file names are as they are written, empty where there are none.
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
  std::vector<std::string> faults;  ///< what is not read as it stands there, one line each
};

/// The materials in the order of the file; other statements are passed over, as those before the first `newmtl`. As in
/// Mitsuba 0.6, colours are encoded as sRGB, and of a number and a file for the same thing the later one counts. Throws
/// std::runtime_error with line and text for numbers that are none.
std::vector<MtlMaterial> parseMtl(std::string_view text);

}  // namespace lobe
