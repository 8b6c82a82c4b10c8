#pragma once
// The Sobol' sequence in up to kSobolDimensions dimensions, and its Owen scrambling by hashing.

#include <cstdint>

namespace lobe {

inline constexpr int kSobolDimensions = 20;

/// Coordinate `dimension` in [0, kSobolDimensions) of point `index` of the Sobol' sequence, as a fraction of 2³² (Joe
/// and Kuo 2008, direction numbers new-joe-kuo-6).
std::uint32_t sobol(std::uint32_t index, int dimension);

/// Nested uniform (Owen) scrambling of a coordinate: a random permutation of the tree of binary digits, by a hash
/// (Burley 2020, "Practical Hash-based Owen Scrambling", with the constants of Listing 3). Different seeds give
/// independent permutations; every stratification of the unscrambled points is kept.
std::uint32_t owenScramble(std::uint32_t x, std::uint32_t seed);

}  // namespace lobe
