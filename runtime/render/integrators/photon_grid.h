#pragma once
// The vertices of light paths for vertex merging, sorted into the cells of a hashed grid.

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "runtime/core/sampling.h"
#include "runtime/render/integrators/partial_weights.h"

namespace lobe {

/// A vertex of a light path.
struct Photon {
  Vec3 position;
  Vec3 normal;     ///< unit, geometric
  Vec3 direction;  ///< unit, from which the light came
  Rgb flux;
  PartialWeights weights;
  int depth;   ///< segments from the light
  bool delta;  ///< whether the vertex next to the light scatters by a delta component
};

class PhotonGrid {
 public:
  /// radius > 0: within which photons are found. The result depends on the photons and their order only.
  PhotonGrid(const std::vector<Photon>& photons, float radius);

  /// The area of the disc in which photons are found on a flat surface.
  double area() const { return areaOf(radius_); }
  static double areaOf(float radius) { return static_cast<double>(kPi) * radius * radius; }

  /// Calls use(photon) for all photons within the radius, always in the same order.
  template <class Use>
  void forEachNear(const Vec3& position, const Use& use) const {
    // Cells are as wide as the sphere of the radius, which therefore meets at most two of them along each axis.
    const Eigen::Array3i first = cellOf(position - Vec3::Constant(radius_));
    std::array<std::uint32_t, 8> visited;
    auto end = visited.begin();
    for (int corner = 0; corner < 8; ++corner) {
      const std::uint32_t bucket = bucketOf(first + Eigen::Array3i(corner & 1, corner >> 1 & 1, corner >> 2 & 1));
      if (std::find(visited.begin(), end, bucket) != end) continue;  // cells may share a bucket
      *end++ = bucket;
      for (std::uint32_t i = starts_[bucket]; i < starts_[bucket + 1]; ++i)
        if ((photons_[i].position - position).squaredNorm() <= radius_ * radius_) use(photons_[i]);
    }
  }

 private:
  Eigen::Array3i cellOf(const Vec3& position) const {
    return (position.array() * inverseWidth_).floor().cwiseMax(-1e9f).cwiseMin(1e9f).cast<int>();
  }
  std::uint32_t bucketOf(const Eigen::Array3i& cell) const;

  float radius_, inverseWidth_;
  std::vector<Photon> photons_;        // by bucket
  std::vector<std::uint32_t> starts_;  // of each bucket, then the number of photons
};

}  // namespace lobe
