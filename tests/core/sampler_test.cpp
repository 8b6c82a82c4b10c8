#include <algorithm>
#include <vector>

#include <catch2/catch.hpp>

#include "runtime/core/sampler.h"

namespace lobe {
namespace {

/// Whether each of n = 2^k equal cells of an axis holds one of n values.
bool onePerCell(std::vector<float> values) {
  std::ranges::sort(values);
  const auto n = static_cast<float>(values.size());
  for (std::size_t i = 0; i < values.size(); ++i)
    if (static_cast<std::size_t>(values[i] * n) != i) return false;
  return true;
}

TEST_CASE("core: every dimension of a scrambled Sobol sequence is stratified") {
  for (const std::uint64_t pixel : {0u, 7u}) {
    std::vector<std::vector<float>> dimensions(kSobolDimensions);
    for (std::uint32_t i = 0; i < 256; ++i) {
      Sampler sampler = Sampler::stratified(3, pixel, i);
      for (auto& d : dimensions) d.push_back(sampler.stratified());
    }
    for (const auto& d : dimensions) CHECK(onePerCell(d));
  }
}

TEST_CASE("core: stratified numbers of double precision are those of the sequence with more digits") {
  int equal = 0;
  for (std::uint32_t i = 0; i < 64; ++i) {
    const double fine = Sampler::stratified(3, 1, i).stratifiedDouble();
    const float coarse = Sampler::stratified(3, 1, i).stratified();
    CHECK(fine >= coarse);
    CHECK(fine < coarse + 0x1p-24);
    equal += fine == coarse;
  }
  CHECK(equal == 0);
}

TEST_CASE("core: the first two dimensions fill every elementary interval") {
  // A (0, m, 2)-net in base 2: each of 2^m boxes of any shape with area 2^-m holds one of 2^m points.
  constexpr int kBits = 8;
  std::vector<Eigen::Vector2f> points;
  for (std::uint32_t i = 0; i < 1 << kBits; ++i) points.push_back(Sampler::stratified(5, 2, i).stratified2());
  for (int across = 0; across <= kBits; ++across) {
    std::vector<int> boxes(1 << kBits);
    for (const Eigen::Vector2f& p : points) {
      const int column = static_cast<int>(p.x() * static_cast<float>(1 << across));
      const int row = static_cast<int>(p.y() * static_cast<float>(1 << (kBits - across)));
      ++boxes[static_cast<std::size_t>(row * (1 << across) + column)];
    }
    CHECK(std::ranges::all_of(boxes, [](int n) { return n == 1; }));
  }
}

TEST_CASE("core: samplers of different pixels and seeds are scrambled differently") {
  const float a = Sampler::stratified(1, 1, 0).stratified(), b = Sampler::stratified(1, 2, 0).stratified(),
              c = Sampler::stratified(2, 1, 0).stratified();
  CHECK(a != b);
  CHECK(a != c);
  // The mean over scramblings of each point is that of uniform numbers.
  double sum = 0;
  for (std::uint64_t pixel = 0; pixel < 4000; ++pixel) sum += Sampler::stratified(1, pixel, 5).stratified();
  CHECK(sum / 4000 == Approx(0.5).margin(0.02));
}

TEST_CASE("core: a sampler continues with independent numbers after the last dimension") {
  Sampler sampler = Sampler::stratified(1, 1, 1), other = Sampler::stratified(1, 1, 1);
  for (int i = 0; i < kSobolDimensions; ++i) sampler.stratified();
  CHECK(sampler.stratified() == other.uniform());
}

}  // namespace
}  // namespace lobe
