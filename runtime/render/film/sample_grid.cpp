#include "runtime/render/film/sample_grid.h"

#include <cmath>
#include <numeric>

#include "runtime/core/parallel.h"
#include "runtime/render/film/film.h"

namespace lobe {
namespace {

constexpr int kWidestBorder = 16;

}  // namespace

int GridFilter::border(const FilterSampler& filter) {
  const float border = std::ceil(filter.radius() - 0.5f);
  return border <= kWidestBorder ? static_cast<int>(border) : 0;
}

double GridFilter::relativeVariance(const FilterSampler& filter) {
  constexpr int kOffsets = 64;
  double sum = 0;
  for (int i = 0; i < kOffsets; ++i) {
    const float u = (static_cast<float>(i) + 0.5f) / kOffsets;
    for (const float weight : weights(filter, sampleOffset(filter, Vec2(u, u)).x())) sum += weight * weight;
  }
  return std::pow(sum / kOffsets, 2);
}

Vec2 GridFilter::sampleOffset(const FilterSampler& filter, const Vec2& u) {
  const Vec2 point = filter.sample(u);
  return point - point.array().round().matrix();
}

GridFilter::GridFilter(int width, int height, const FilterSampler& filter)
    : filter_(filter),
      width_(width),
      height_(height),
      border_(border(filter)),
      rows_(width, height, border_),
      image_(width, height, border_) {}

std::vector<float> GridFilter::weights(const FilterSampler& filter, float offset) {
  const int border = GridFilter::border(filter);
  std::vector<float> result;
  for (int step = -border; step <= border; ++step) result.push_back(filter.density(static_cast<float>(step) + offset));
  const float sum = std::accumulate(result.begin(), result.end(), 0.0f);
  // Rounding may move an offset out of the filter.
  if (!(sum > 0.0f)) result[border] = 1.0f;
  for (float& weight : result) weight /= sum > 0.0f ? sum : 1.0f;
  return result;
}

void GridFilter::apply(const SampleGrid& grid, const Vec2& offset) {
  const std::vector<float> wx = weights(filter_, offset.x()), wy = weights(filter_, offset.y());
  parallelFor(-border_, height_ + border_, [&](int y) {
    for (int x = -border_; x < width_ + border_; ++x)
      image_.at(x, y) = isUsableSample(grid.at(x, y)) ? grid.at(x, y) : Rgb(Rgb::Zero());
    for (int x = 0; x < width_; ++x) {
      Rgb sum = Rgb::Zero();
      for (int step = -border_; step <= border_; ++step) sum += wx[step + border_] * image_.at(x + step, y);
      rows_.at(x, y) = sum;
    }
  });
  parallelFor(0, height_, [&](int y) {
    for (int x = 0; x < width_; ++x) {
      Rgb sum = Rgb::Zero();
      for (int step = -border_; step <= border_; ++step) sum += wy[step + border_] * rows_.at(x, y + step);
      image_.at(x, y) = isUsableSample(grid.at(x, y)) ? sum : grid.at(x, y);
    }
  });
}

}  // namespace lobe
