#pragma once
// The random numbers of one path: low-discrepancy points for the dimensions that matter most, independent numbers for
// the others.

#include <algorithm>
#include <cstdint>

#include "runtime/core/random.h"
#include "runtime/core/sobol.h"

namespace lobe {

/// Hands out numbers in the order in which a path asks for them. Each number is uniform in [0, 1) and independent of
/// the others of the same path, so that every estimate is unbiased; the stratified numbers of different paths of a
/// pixel depend on each other, which is what lowers the error of their mean.
class Sampler {
 public:
  /// Independent numbers only. Arguments as those of Rng.
  explicit Sampler(std::uint64_t seed, std::uint64_t stream = 0, std::uint64_t index = 0)
      : rng_(seed, stream, index), dimension_(kSobolDimensions), index_(0), scramble_(0) {}

  /// Sample `index` of a pixel: the first kSobolDimensions stratified numbers are those of an Owen-scrambled Sobol'
  /// sequence, with a scrambling of its own for each (seed, pixel).
  static Sampler stratified(std::uint64_t seed, std::uint64_t pixel, std::uint32_t index) {
    Sampler sampler(seed, pixel, index);
    sampler.dimension_ = 0;
    sampler.index_ = index;
    sampler.scramble_ = Rng(seed, pixel).next();
    return sampler;
  }

  /// A sampler for a further branch of the path, which starts at the same dimension: its numbers are independent of
  /// those of this sampler, and stratified among the k-th branches that the samples of a pixel make at this dimension.
  Sampler branch() {
    Sampler result = *this;
    const std::uint64_t seed = rng_.next();
    result.rng_ = Rng((seed << 32) | rng_.next());
    result.scramble_ =
        mixed(scramble_ + 0x9e3779b9u * static_cast<std::uint32_t>(++branches_ * kSobolDimensions + dimension_ + 1));
    result.branches_ = 0;
    return result;
  }

  /// Leaves out stratified numbers, so that the others keep their dimensions.
  void skip(int count) { dimension_ = std::min(dimension_ + count, kSobolDimensions); }

  /// Independent of all other numbers. For decisions such as Russian roulette.
  float uniform() { return rng_.uniform(); }
  double uniformDouble() { return rng_.uniformDouble(); }
  Eigen::Vector2f uniform2() { return rng_.uniform2(); }

  /// For the position on the film and the lens, and for the choice of lights and directions at the first vertices.
  float stratified() {
    if (dimension_ >= kSobolDimensions) return rng_.uniform();
    return static_cast<float>(nextCoordinate() >> 8) * 0x1p-24f;
  }
  /// One dimension with 53 bits; those that the sequence does not have are independent.
  double stratifiedDouble() {
    if (dimension_ >= kSobolDimensions) return rng_.uniformDouble();
    const std::uint64_t high = nextCoordinate();
    return static_cast<double>((high << 32 | rng_.next()) >> 11) * 0x1p-53;
  }
  Eigen::Vector2f stratified2() {
    const float x = stratified();
    return {x, stratified()};
  }

 private:
  // The next coordinate of the scrambled point, as a fraction of 2³².
  std::uint32_t nextCoordinate() {
    const std::uint32_t seed = scramble_ ^ (0x9e3779b9u * static_cast<std::uint32_t>(dimension_ + 1));
    return owenScramble(sobol(index_, dimension_++), mixed(seed));
  }

  // A 32-bit finaliser (MurmurHash3).
  static std::uint32_t mixed(std::uint32_t x) {
    x = (x ^ (x >> 16)) * 0x85ebca6bu;
    x = (x ^ (x >> 13)) * 0xc2b2ae35u;
    return x ^ (x >> 16);
  }

  Rng rng_;
  int dimension_;
  int branches_ = 0;  // made so far
  std::uint32_t index_, scramble_;
};

}  // namespace lobe
