#include "runtime/render/film/light_image.h"

#include <algorithm>
#include <cmath>

#include "runtime/core/parallel.h"

namespace lobe {
namespace {

constexpr int kRows = 16;  // that one task sums

bool above(const Splat& a, const Splat& b) {
  return a.film.y() < b.film.y();
}

}  // namespace

void LightImage::sum(std::span<std::vector<Splat>> lists) {
  parallelFor(std::size_t{0}, lists.size(), [&](std::size_t i) { std::ranges::stable_sort(lists[i], above); });
  const int height = camera_.height();
  parallelFor(0, (height + kRows - 1) / kRows,
              [&](int band) { sumRows(lists, band * kRows, std::min(height, (band + 1) * kRows)); });
}

void LightImage::sumRows(std::span<const std::vector<Splat>> lists, int first, int last) {
  const auto row = [&](int y) { return sums_.begin() + static_cast<std::ptrdiff_t>(y) * camera_.width(); };
  std::fill(row(first), row(last), Sum::Zero());
  const float radius = camera_.filter().radius();
  const auto at = [](float y) { return Splat{Vec2(0.0f, y), Rgb::Zero(), 0}; };
  for (const std::vector<Splat>& list : lists) {
    const auto begin = std::ranges::lower_bound(list, at(static_cast<float>(first) - radius), above);
    const auto end = std::ranges::upper_bound(list, at(static_cast<float>(last) + radius), above);
    for (auto splat = begin; splat != end; ++splat) add(*splat, first, last);
  }
}

void LightImage::add(const Splat& splat, int first, int last) {
  const FilterSampler& filter = camera_.filter();
  // The first pixel whose centre is at most the radius away, on one axis.
  const auto from = [&](float x) { return static_cast<int>(std::ceil(x - filter.radius() - 0.5f)); };
  const auto to = [&](float x) { return static_cast<int>(std::floor(x + filter.radius() - 0.5f)) + 1; };
  const Vec2& p = splat.film;
  for (int y = std::max(first, from(p.y())); y < std::min(last, to(p.y())); ++y)
    for (int x = std::max(0, from(p.x())); x < std::min(camera_.width(), to(p.x())); ++x) {
      const float weight = filter.density(p - Vec2(x + 0.5f, y + 0.5f));
      if (weight > 0.0f)
        sums_[static_cast<std::size_t>(y) * camera_.width() + x] += (splat.value * weight).cast<double>();
    }
}

}  // namespace lobe
