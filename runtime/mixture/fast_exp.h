#pragma once
// The exponential for the inner loops of mixtures: inline and without branches, so that loops over it vectorise.

#include <bit>
#include <cstdint>

namespace lobe {

/// exp(x) for x ≤ 0 with a relative error below 3e-7; exactly 0 below −87, near the smallest normal float.
inline float expNegative(float x) {
  constexpr float kRound = 0x1.8p23f;  // adding it rounds to an integer, held in the low mantissa bits
  constexpr float kLog2e = 1.44269504f, kLn2High = 0.693359375f, kLn2Low = -2.12194440e-4f;
  constexpr float kLowest = -87.0f;
  const float clamped = x > kLowest ? x : kLowest;
  const float shifted = clamped * kLog2e + kRound;
  const float n = shifted - kRound;
  const float r = (clamped - n * kLn2High) - n * kLn2Low;
  // Taylor polynomial of degree 6 on |r| ≤ ½ ln 2.
  const float p =
      1.0f + r * (1.0f + r * (1.0f / 2 + r * (1.0f / 6 + r * (1.0f / 24 + r * (1.0f / 120 + r * (1.0f / 720))))));
  const auto exponent = (std::bit_cast<std::int32_t>(shifted) - std::bit_cast<std::int32_t>(kRound) + 127) << 23;
  return x > kLowest ? p * std::bit_cast<float>(exponent) : 0.0f;
}

}  // namespace lobe
