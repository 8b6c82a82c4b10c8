#include "runtime/render/integrators/photon_grid.h"

#include <numeric>

namespace lobe {

PhotonGrid::PhotonGrid(const std::vector<Photon>& photons, float radius)
    : radius_(radius), inverseWidth_(0.5f / radius), starts_(photons.size() + 2) {
  std::vector<std::uint32_t> buckets;
  buckets.reserve(photons.size());
  for (const Photon& photon : photons) ++starts_[buckets.emplace_back(bucketOf(cellOf(photon.position))) + 1];
  std::partial_sum(starts_.begin(), starts_.end(), starts_.begin());
  std::vector<std::uint32_t> next = starts_, order(photons.size());
  for (std::uint32_t i = 0; i < photons.size(); ++i) order[next[buckets[i]]++] = i;
  photons_.reserve(photons.size());
  for (const std::uint32_t i : order) photons_.push_back(photons[i]);
}

std::uint32_t PhotonGrid::bucketOf(const Eigen::Array3i& cell) const {
  // The hash of Teschner et al. 2003, "Optimized Spatial Hashing for Collision Detection of Deformable Objects".
  const auto x = static_cast<std::uint32_t>(cell.x()), y = static_cast<std::uint32_t>(cell.y()),
             z = static_cast<std::uint32_t>(cell.z());
  return static_cast<std::uint32_t>((x * 73856093u ^ y * 19349663u ^ z * 83492791u) % (starts_.size() - 1));
}

}  // namespace lobe
