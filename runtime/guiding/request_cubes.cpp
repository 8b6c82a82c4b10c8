#include "runtime/guiding/request_cubes.h"

#include <algorithm>
#include <limits>

#include "runtime/core/parallel.h"

namespace lobe {
namespace {

// 20 bits per axis. In a grid of more than 2^20 cubes per axis keys wrap around and distant cubes are one, which is
// harmless because parities and neighbours are preserved.
constexpr int kBits = 20;
constexpr std::uint64_t kMask = (1u << kBits) - 1;
constexpr std::uint64_t kNoCube = std::numeric_limits<std::uint64_t>::max();

std::uint64_t keyOf(const Eigen::Vector3i& c) {
  return (static_cast<std::uint64_t>(c.x()) & kMask) | (static_cast<std::uint64_t>(c.y()) & kMask) << kBits |
         (static_cast<std::uint64_t>(c.z()) & kMask) << 2 * kBits;
}

Eigen::Vector3i coordinatesOf(std::uint64_t key) {
  return {static_cast<int>(key & kMask), static_cast<int>(key >> kBits & kMask),
          static_cast<int>(key >> 2 * kBits & kMask)};
}

struct Keyed {
  std::uint64_t key;
  std::uint32_t request;
};

}  // namespace

RequestCubes::RequestCubes(std::span<const RecordRequest> requests, float edge,
                           const std::function<bool(const RecordRequest&)>& counts) {
  std::vector<Keyed> keyed(requests.size());
  parallelFor(std::size_t{0}, requests.size(), [&](std::size_t i) {
    const RecordRequest& r = requests[i];
    constexpr float kOutermost = 1 << 30;  // as in IlluminationCache: farther points do not fit into integers
    const Eigen::Vector3i cube = (r.position / edge).array().floor().max(-kOutermost).min(kOutermost).cast<int>();
    keyed[i] = {counts(r) ? keyOf(cube) : kNoCube, static_cast<std::uint32_t>(i)};
  });
  parallelSort(keyed,
               [](const Keyed& a, const Keyed& b) { return a.key != b.key ? a.key < b.key : a.request < b.request; });
  requests_.reserve(keyed.size());
  for (const Keyed& k : keyed) {
    if (k.key == kNoCube) break;
    if (cubes_.empty() || cubes_.back().key != k.key) cubes_.push_back({k.key, requests_.size(), 0});
    requests_.push_back(k.request);
    cubes_.back().end = requests_.size();
  }
}

std::vector<std::size_t> RequestCubes::ofParity(int parity) const {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < cubes_.size(); ++i) {
    const Eigen::Vector3i c = coordinatesOf(cubes_[i].key);
    if ((c.x() & 1) + 2 * (c.y() & 1) + 4 * (c.z() & 1) == parity) found.push_back(i);
  }
  return found;
}

std::span<const std::uint32_t> RequestCubes::requests(std::size_t cube) const {
  return std::span(requests_).subspan(cubes_[cube].begin, cubes_[cube].end - cubes_[cube].begin);
}

std::vector<std::size_t> RequestCubes::around(std::size_t cube) const {
  const Eigen::Vector3i centre = coordinatesOf(cubes_[cube].key);
  std::vector<std::size_t> found;
  for (int i = 0; i < 27; ++i) {
    const std::uint64_t key = keyOf(centre + Eigen::Vector3i(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1));
    const auto at = std::ranges::lower_bound(cubes_, key, {}, &Cube::key);
    if (at != cubes_.end() && at->key == key) found.push_back(static_cast<std::size_t>(at - cubes_.begin()));
  }
  return found;
}

}  // namespace lobe
