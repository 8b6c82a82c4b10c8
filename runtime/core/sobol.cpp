#include "runtime/core/sobol.h"

#include <array>

namespace lobe {
namespace {

constexpr int kBits = 32;

/// A primitive polynomial of a degree, whose inner coefficients are the bits of `inner`, and the first direction
/// numbers.
struct Generator {
  int degree;
  std::uint32_t inner;
  std::array<std::uint32_t, 7> first;
};

// Dimensions 2 to 20 of new-joe-kuo-6; dimension 1 is the van der Corput sequence.
constexpr std::array<Generator, kSobolDimensions - 1> kGenerators{{{1, 0, {1}},
                                                                   {2, 1, {1, 3}},
                                                                   {3, 1, {1, 3, 1}},
                                                                   {3, 2, {1, 1, 1}},
                                                                   {4, 1, {1, 1, 3, 3}},
                                                                   {4, 4, {1, 3, 5, 13}},
                                                                   {5, 2, {1, 1, 5, 5, 17}},
                                                                   {5, 4, {1, 1, 5, 5, 5}},
                                                                   {5, 7, {1, 1, 7, 11, 19}},
                                                                   {5, 11, {1, 1, 5, 1, 1}},
                                                                   {5, 13, {1, 1, 1, 3, 11}},
                                                                   {5, 14, {1, 3, 5, 5, 31}},
                                                                   {6, 1, {1, 3, 3, 9, 7, 49}},
                                                                   {6, 13, {1, 1, 1, 15, 21, 21}},
                                                                   {6, 16, {1, 3, 1, 13, 27, 49}},
                                                                   {6, 19, {1, 1, 1, 15, 7, 5}},
                                                                   {6, 22, {1, 3, 1, 15, 13, 25}},
                                                                   {6, 25, {1, 1, 5, 5, 19, 61}},
                                                                   {7, 1, {1, 3, 7, 11, 23, 15, 103}}}};

using Matrix = std::array<std::uint32_t, kBits>;

constexpr Matrix directionsOf(const Generator& g) {
  Matrix v{};
  for (int i = 0; i < kBits; ++i) {
    if (i < g.degree) {
      v[i] = g.first[i] << (kBits - 1 - i);
      continue;
    }
    v[i] = v[i - g.degree] ^ (v[i - g.degree] >> g.degree);
    for (int k = 1; k < g.degree; ++k)
      if (g.inner >> (g.degree - 1 - k) & 1) v[i] ^= v[i - k];
  }
  return v;
}

constexpr std::array<Matrix, kSobolDimensions> makeDirections() {
  std::array<Matrix, kSobolDimensions> all{};
  for (int i = 0; i < kBits; ++i) all[0][i] = 1u << (kBits - 1 - i);
  for (int d = 1; d < kSobolDimensions; ++d) all[d] = directionsOf(kGenerators[d - 1]);
  return all;
}

constexpr std::array<Matrix, kSobolDimensions> kDirections = makeDirections();

constexpr std::uint32_t reversed(std::uint32_t x) {
  x = (x >> 16) | (x << 16);
  x = ((x & 0xff00ff00u) >> 8) | ((x & 0x00ff00ffu) << 8);
  x = ((x & 0xf0f0f0f0u) >> 4) | ((x & 0x0f0f0f0fu) << 4);
  x = ((x & 0xccccccccu) >> 2) | ((x & 0x33333333u) << 2);
  return ((x & 0xaaaaaaaau) >> 1) | ((x & 0x55555555u) << 1);
}

}  // namespace

std::uint32_t sobol(std::uint32_t index, int dimension) {
  const Matrix& v = kDirections[static_cast<std::size_t>(dimension)];
  std::uint32_t x = 0;
  for (std::size_t i = 0; index != 0; index >>= 1, ++i)
    if (index & 1) x ^= v[i];
  return x;
}

std::uint32_t owenScramble(std::uint32_t x, std::uint32_t seed) {
  x = reversed(x) + seed;
  x ^= x * 0x6c50b47cu;
  x ^= x * 0xb82f1e52u;
  x ^= x * 0xc7afe638u;
  x ^= x * 0x8d22f6e6u;
  return reversed(x);
}

}  // namespace lobe
