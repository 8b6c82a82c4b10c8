#pragma once
// What light paths contribute to the pixels of one sample of the image, and to their differences (light_image.h).

#include <array>
#include <vector>

#include "runtime/render/film/light_image.h"
#include "runtime/render/gradients/gradient_film.h"

namespace lobe {

/// By tile: the splats of one component of GradientSample, the radiance or a difference.
using GradientSplatLists = std::array<std::vector<std::vector<Splat>>, 1 + kNeighbours.size()>;

/// The splats of one tile.
class GradientSplats {
 public:
  GradientSplats(GradientSplatLists& lists, int tile) : lists_(lists), tile_(static_cast<std::size_t>(tile)) {}
  /// A contribution at an image point, and its differences from those at the image points one pixel away.
  void add(const Vec2& film, const GradientSample& sample) {
    lists_[0][tile_].push_back({film, sample.radiance});
    for (std::size_t i = 0; i < kNeighbours.size(); ++i) lists_[1 + i][tile_].push_back({film, sample.differences[i]});
  }

 private:
  GradientSplatLists& lists_;
  std::size_t tile_;
};

class GradientLightImage {
 public:
  /// The camera must outlive the image.
  explicit GradientLightImage(const RayCamera& camera) : images_(1 + kNeighbours.size(), LightImage(camera)) {}

  /// Begins a sample.
  void clear(int tiles) {
    for (auto& lists : lists_) lists.assign(static_cast<std::size_t>(tiles), {});
  }
  GradientSplats splats(int tile) { return {lists_, tile}; }
  /// Sums the splats of all tiles; the same to the bit on any number of threads.
  void sum() {
    for (std::size_t i = 0; i < images_.size(); ++i) images_[i].sum(lists_[i]);
  }
  GradientSample at(int x, int y) const {
    GradientSample sample{images_[0].at(x, y)};
    for (std::size_t i = 0; i < kNeighbours.size(); ++i) sample.differences[i] = images_[1 + i].at(x, y);
    return sample;
  }

 private:
  std::vector<LightImage> images_;  // of the components of GradientSample
  GradientSplatLists lists_;
};

}  // namespace lobe
