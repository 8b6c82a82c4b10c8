#pragma once
// What paths contribute to the samples of pixels: the kinds of the largest contributions, and their limit
// (--firefly-limit).

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>

#include "runtime/core/vec.h"

namespace lobe {

/// How a path has found the light: by hitting a light, by next-event estimation, by a connection of its light path to
/// the camera or of both subpaths, or by vertex merging.
enum class Technique : std::uint8_t { emission, nextEvent, lightTracing, connection, merging };
inline constexpr std::array<const char*, 5> kTechniqueNames{"emission", "next_event", "light_tracing", "connection",
                                                            "merging"};

struct PathKind {
  Technique technique;
  int segments;       ///< of the whole path, shadow rays and surfaces that they pass included: 2 for direct light
  bool deltaAtLight;  ///< whether the vertex next to the light scatters by a delta component
};

/// The largest contributions by luminance. The same for the same contributions in any order.
class LargestContributions {
 public:
  static constexpr std::size_t kCount = 64;
  /// Luminance and kind; 0: none. Larger for a larger luminance.
  using Key = std::uint64_t;

  void add(float luminance, const PathKind& kind) {
    if (!(luminance > 0) || !std::isfinite(luminance)) return;
    const auto segments = static_cast<Key>(std::min(kind.segments, kMostSegments));
    add(static_cast<Key>(std::bit_cast<std::uint32_t>(luminance)) << 32 | segments << 16 |
        static_cast<Key>(kind.technique) << 8 | static_cast<Key>(kind.deltaAtLight));
  }
  void add(const LargestContributions& other) {
    for (const Key key : other.keys) add(key);
  }

  static float luminanceOf(Key key) { return std::bit_cast<float>(static_cast<std::uint32_t>(key >> 32)); }
  static PathKind kindOf(Key key) {
    return {static_cast<Technique>(key >> 8 & 0xff), static_cast<int>(key >> 16 & 0xffff), (key & 1) != 0};
  }

  /// Whether the keys, which may come from a file, are a possible result of add.
  bool isValid() const { return std::ranges::is_heap(keys, std::greater<>()) && std::ranges::all_of(keys, isPossible); }

  std::array<Key, kCount> keys{};  ///< a heap, with the least in front

 private:
  static constexpr int kMostSegments = 0xffff;
  static bool isPossible(Key key) {
    const float value = luminanceOf(key);
    const auto technique = static_cast<std::size_t>(kindOf(key).technique);
    return key == 0 || (value > 0 && std::isfinite(value) && technique < kTechniqueNames.size());
  }
  void add(Key key) {
    if (key <= keys.front()) return;
    std::pop_heap(keys.begin(), keys.end(), std::greater<>());
    keys.back() = key;
    std::push_heap(keys.begin(), keys.end(), std::greater<>());
  }
};

/// Sum of what was cut off by a limit, as a multiple of it. Integers, so that sums do not depend on their order.
class CutLight {
 public:
  void add(double excess, double limit) { units += saturated(excess / limit * kUnit); }
  void add(const CutLight& other) { units += other.units; }
  double times(double limit) const { return static_cast<double>(units) / kUnit * limit; }

  std::uint64_t units = 0;

 private:
  static constexpr double kUnit = 0x1p16;
  // A single sample that is this large makes any picture useless.
  static std::uint64_t saturated(double x) { return static_cast<std::uint64_t>(std::min(x, 0x1p44)); }
};

/// The radiance that the paths of one sample have found. Indirect light is that of paths with three or more segments,
/// which means at least two scattering events; passing through a surface counts.
class FoundLight {
 public:
  void add(const Rgb& value, int segments) { (segments < kIndirect ? direct_ : indirect_) += value; }
  void add(const FoundLight& other) { direct_ += other.direct_, indirect_ += other.indirect_; }
  Rgb total() const { return direct_ + indirect_; }

  /// The total, with the indirect light scaled to a luminance of at most `limit` > 0. Adds what is cut off to `cut`.
  Rgb limited(float limit, CutLight& cut) const { return direct_ + limitedIndirect(indirect_, limit, cut); }
  /// The same for one contribution.
  static Rgb limited(const Rgb& value, int segments, float limit, CutLight& cut) {
    return segments < kIndirect ? value : limitedIndirect(value, limit, cut);
  }

 private:
  static constexpr int kIndirect = 3;
  static Rgb limitedIndirect(const Rgb& value, float limit, CutLight& cut) {
    const float found = luminance(value);
    if (!(found > limit) || !std::isfinite(found)) return value;
    cut.add(static_cast<double>(found) - limit, limit);
    return value * (limit / found);
  }

  Rgb direct_ = Rgb::Zero(), indirect_ = Rgb::Zero();
};

}  // namespace lobe
