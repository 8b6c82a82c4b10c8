#include "runtime/render/gradients/gradient_film.h"

#include <algorithm>
#include <limits>

namespace lobe {

void GradientFilm::add(int x, int y, const GradientSample& sample) {
  const bool finite = std::ranges::all_of(sample.differences, [](const Rgb& d) { return d.allFinite(); });
  const Rgb radiance = sample.radiance + sample.visible;
  const std::uint32_t before = pixels_.pixel(x, y).count;
  pixels_.add(x, y, finite ? radiance : Rgb(Rgb::Constant(std::numeric_limits<float>::quiet_NaN())));
  if (pixels_.pixel(x, y).count == before) return;
  const std::size_t pixel = indexOf(x, y);
  Sums& sums = sums_[pixel];
  if (before == 0) sums.fill(Eigen::Array3d::Zero());
  for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += sample.differences[i].cast<double>();
  visible_[pixel] += sample.visible.cast<double>();
}

Eigen::Array3d GradientFilm::meanOf(const Eigen::Array3d& sum, int x, int y) const {
  const std::uint32_t count = pixels_.pixel(x, y).count;
  return count == 0 ? Eigen::Array3d::Zero() : Eigen::Array3d(sum / count);
}

Eigen::Array3d GradientFilm::meanDifference(int x, int y, std::size_t direction) const {
  return meanOf(sums_[indexOf(x, y)][direction], x, y);
}

Image GradientFilm::mean() const {
  Image result(pixels_.width(), pixels_.height());
  for (int y = 0; y < pixels_.height(); ++y)
    for (int x = 0; x < pixels_.width(); ++x) {
      const double* sum = pixels_.pixel(x, y).sum;
      const Eigen::Array3d all(sum[0], sum[1], sum[2]);
      result.at(x, y) = meanOf(all - visible_[indexOf(x, y)], x, y).cast<float>();
    }
  return result;
}

Image GradientFilm::visible() const {
  Image result(pixels_.width(), pixels_.height());
  for (int y = 0; y < pixels_.height(); ++y)
    for (int x = 0; x < pixels_.width(); ++x) result.at(x, y) = meanOf(visible_[indexOf(x, y)], x, y).cast<float>();
  return result;
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
  ReconstructedImage result{lobe::reconstruct(mean(), dx(), dy(), norm), 0};
  const Image seen = visible();
  for (std::size_t i = 0; i < seen.pixels.size(); ++i) result.image.pixels[i] += seen.pixels[i];
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
