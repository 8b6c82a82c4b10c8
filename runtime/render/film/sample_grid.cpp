#include "runtime/render/film/sample_grid.h"

#include <cmath>

#include "runtime/core/parallel.h"
#include "runtime/render/film/film.h"

namespace lobe {

int SampleGrid::border(const FilterSampler& filter) {
  return static_cast<int>(std::ceil(filter.radius() - 0.5f));
}

SampleGrid::SampleGrid(int width, int height, const FilterSampler& filter)
    : filter_(filter),
      width_(width),
      height_(height),
      border_(border(filter)),
      columns_(static_cast<std::size_t>(width) + 2 * border_),
      points_(columns_ * (height + 2 * border_)),
      rows_(points_.size()),
      filtered_(points_.size()) {}

std::vector<float> SampleGrid::weights(float offset) const {
  std::vector<float> result;
  for (int step = -border_; step <= border_; ++step)
    result.push_back(filter_.density(static_cast<float>(step) + offset));
  return result;
}

void SampleGrid::convolve(const Vec2& offset) {
  const std::vector<float> wx = weights(offset.x()), wy = weights(offset.y());
  parallelFor(-border_, height_ + border_, [&](int y) {
    for (int x = -border_; x < width_ + border_; ++x)
      filtered_[index(x, y)] = isUsableSample(at(x, y)) ? at(x, y) : Rgb(Rgb::Zero());
    for (int x = 0; x < width_; ++x) {
      Rgb sum = Rgb::Zero();
      for (int step = -border_; step <= border_; ++step) sum += wx[step + border_] * filtered_[index(x + step, y)];
      rows_[index(x, y)] = sum;
    }
  });
  parallelFor(0, height_, [&](int y) {
    for (int x = 0; x < width_; ++x) {
      Rgb sum = Rgb::Zero();
      for (int step = -border_; step <= border_; ++step) sum += wy[step + border_] * rows_[index(x, y + step)];
      filtered_[index(x, y)] = isUsableSample(at(x, y)) ? sum : at(x, y);
    }
  });
}

}  // namespace lobe
