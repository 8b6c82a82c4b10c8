#pragma once
// The AOVs (arbitrary output variables) of a picture: what is stored about each pixel besides its colour, as layers of
// the same .exr file, with the names that compositing programs and denoisers expect.

#include <map>
#include <string>

#include "runtime/image/image_output.h"

namespace lobe {

enum class Aov {
  albedo,    ///< albedo.R, .G, .B: in [0,1]
  normal,    ///< normal.X, .Y, .Z: in world space; at most of length 1
  depth,     ///< depth.Z: distance along the camera's axis of the nearest surface of the pixel
  variance,  ///< variance.R, .G, .B: of the mean of the samples, that is of the pixel; 0: unknown
  samples,   ///< samples.Y: number of samples of which the pixel is the mean
};

/// All names, in the order of Aov.
inline constexpr std::array kAovNames{"albedo", "normal", "depth", "variance", "samples"};

/// Pictures with one AOV each, of the size of the picture. Those with one channel have it in all three.
using Aovs = std::map<Aov, Image>;

/// The layers for writeImage. depth, variance and samples are always stored as floats.
std::vector<ImageLayer> layersOf(const Aovs& aovs);

/// The AOVs that an .exr file has; channels with other names are ignored. Throws std::runtime_error that names the
/// file.
Aovs readAovs(const std::filesystem::path& path);

}  // namespace lobe
