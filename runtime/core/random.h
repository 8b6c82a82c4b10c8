#pragma once
// A small random number generator whose streams are cheap to create. Each pixel sample, particle or record uses a
// stream of its own, so that results do not depend on the assignment of work to threads.

#include <cstdint>

#include <Eigen/Core>

namespace lobe {

/// PCG32 (O'Neill 2014), seeded by hashing.
class Rng {
 public:
  /// Different triples (seed, stream, index) give streams that are independent for practical purposes.
  explicit Rng(std::uint64_t seed, std::uint64_t stream = 0, std::uint64_t index = 0)
      : state_(mix(seed + 0x9e3779b97f4a7c15ull * (index + 1))), increment_((mix(stream ^ state_) << 1) | 1) {
    next();
  }

  std::uint32_t next() {
    const std::uint64_t old = state_;
    state_ = old * 6364136223846793005ull + increment_;
    const auto shifted = static_cast<std::uint32_t>(((old >> 18) ^ old) >> 27);
    const auto rotation = static_cast<std::uint32_t>(old >> 59);
    return (shifted >> rotation) | (shifted << ((32 - rotation) & 31));
  }

  /// Uniform in [0, 1), 24 bits.
  float uniform() { return static_cast<float>(next() >> 8) * 0x1p-24f; }
  /// Uniform in [0, 1), 53 bits: enough to choose one of many lights and then one of many triangles with one number.
  double uniformDouble() {
    const std::uint64_t high = next();
    return static_cast<double>((high << 32 | next()) >> 11) * 0x1p-53;
  }
  Eigen::Vector2f uniform2() {
    const float x = uniform();
    return {x, uniform()};
  }

 private:
  // The finalizer of SplitMix64 (Steele et al. 2014).
  static std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return z ^ (z >> 31);
  }
  std::uint64_t state_;
  std::uint64_t increment_;
};

}  // namespace lobe
