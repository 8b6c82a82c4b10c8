#include "runtime/render/gradients/gradient_film.h"

#include <algorithm>
#include <limits>

namespace lobe {

void GradientFilm::add(int x, int y, const GradientSample& sample) {
  const bool finite = std::ranges::all_of(sample.differences, [](const Rgb& d) { return d.allFinite(); });
  const std::uint32_t before = pixels_.pixel(x, y).count;
  pixels_.add(x, y, finite ? sample.radiance : Rgb(Rgb::Constant(std::numeric_limits<float>::quiet_NaN())));
  if (pixels_.pixel(x, y).count == before) return;
  Sums& sums = sums_[static_cast<std::size_t>(y) * pixels_.width() + x];
  if (before == 0) sums.fill(Eigen::Array3d::Zero());
  for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += sample.differences[i].cast<double>();
}

Eigen::Array3d GradientFilm::meanDifference(int x, int y, std::size_t direction) const {
  const std::uint32_t count = pixels_.pixel(x, y).count;
  if (count == 0) return Eigen::Array3d::Zero();
  return sums_[static_cast<std::size_t>(y) * pixels_.width() + x][direction] / count;
}

Image GradientFilm::differences(std::size_t direction) const {
  const auto [stepX, stepY] = kNeighbours[direction];
  Image result(pixels_.width(), pixels_.height());
  for (int y = 0; y + stepY < pixels_.height(); ++y)
    for (int x = 0; x + stepX < pixels_.width(); ++x)
      result.at(x, y) =
          (meanDifference(x + stepX, y + stepY, direction + 1) - meanDifference(x, y, direction)).cast<float>();
  return result;
}

ReconstructedImage GradientFilm::reconstruct(ReconstructionNorm norm) const {
  ReconstructedImage result{lobe::reconstruct(pixels_.mean(), dx(), dy(), norm), 0};
  double added = 0, sum = 0;
  for (Rgb& pixel : result.image.pixels) {
    const Rgb positive = pixel.max(0.0f);
    added += (positive - pixel).cast<double>().sum();
    sum += positive.cast<double>().sum();
    pixel = positive;
  }
  if (sum > 0) result.clampedFraction = added / sum;
  return result;
}

}  // namespace lobe
