#pragma once
// What light paths contribute to the pixels of one sample of the image. A contribution is added to every pixel whose
// reconstruction filter covers its image point, with the filter's density as weight, so that the image converges to the
// same as one of camera rays.

#include <span>
#include <vector>

#include "runtime/render/film/camera.h"

namespace lobe {

/// A contribution at an image point. The value is for a filter of density 1.
struct Splat {
  Vec2 film;
  Rgb value;
  /// Σ (p_other / p_this)² over the other techniques. The value already contains the weight 1 / (1 + others).
  double others = 0;
};

class LightImage {
 public:
  /// The camera must outlive the image.
  explicit LightImage(const RayCamera& camera)
      : camera_(camera), sums_(static_cast<std::size_t>(camera.width()) * camera.height()) {}

  /// Replaces the image by the sum of the splats of all lists. Every pixel adds them in the order of the lists and, in
  /// each list, from top to bottom, so that the sums are the same to the bit on any number of threads. Sorts each list.
  void sum(std::span<std::vector<Splat>> lists);

  Rgb at(int x, int y) const { return sums_[static_cast<std::size_t>(y) * camera_.width() + x].cast<float>(); }

 private:
  using Sum = Eigen::Array3d;
  void sumRows(std::span<const std::vector<Splat>> lists, int first, int last);
  void add(const Splat& splat, int first, int last);

  const RayCamera& camera_;
  std::vector<Sum> sums_;
};

}  // namespace lobe
