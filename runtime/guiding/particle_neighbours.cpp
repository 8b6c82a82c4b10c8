#include "runtime/guiding/particle_neighbours.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include <Eigen/Geometry>

#include "runtime/core/parallel.h"
#include "runtime/guiding/particle_tree.h"

namespace lobe {
namespace {

constexpr float kNeighbourNormalCosine = 0.707f;

/// The nearest `count` particles on the side of a normal, unordered. Particles of other sides are rejected during the
/// search, because those behind a thin wall could otherwise fill the set. Twice the count is collected before the
/// farther half is dropped, which costs less than keeping the set sorted.
class NearestSet {
 public:
  struct Neighbour {
    float distance2;
    std::uint32_t index;
  };

  NearestSet(std::span<const Particle> particles, const Vec3& n, std::size_t count, float maxDistance2)
      : particles_(particles), n_(n), count_(count), worst_(maxDistance2) {
    neighbours_.reserve(std::min(2 * count, particles.size()));
  }

  std::span<const Neighbour> finish() {
    if (neighbours_.size() > count_) drop();
    return neighbours_;
  }

  float reach2() const { return worst_; }
  void add(float distance2, std::uint32_t index) {
    const Particle& p = particles_[index];
    if (p.normal.dot(n_) < kNeighbourNormalCosine || p.direction.dot(n_) <= 0) return;
    neighbours_.push_back({distance2, index});
    if (neighbours_.size() == 2 * count_) drop();
  }

 private:
  void drop() {
    const auto last = neighbours_.begin() + static_cast<std::ptrdiff_t>(count_) - 1;
    std::nth_element(neighbours_.begin(), last, neighbours_.end(), [](const Neighbour& a, const Neighbour& b) {
      return a.distance2 != b.distance2 ? a.distance2 < b.distance2 : a.index < b.index;
    });
    neighbours_.resize(count_);
    worst_ = neighbours_.back().distance2;
  }

  std::span<const Particle> particles_;
  const Vec3 n_;
  std::size_t count_;
  float worst_;
  std::vector<Neighbour> neighbours_;
};

/// Sums over the particles of one source.
struct Tally {
  double weight = 0, squares = 0, inverseDistance = 0, flux = 0;
  float radius2 = 0;
  std::size_t count = 0;

  double effectiveSamples() const { return squares > 0 ? weight * weight / squares : 0; }

  /// The irradiance by density estimation. reach2: square of the largest distance that was searched. The area is that
  /// of the disc up to the farthest particle, because the surface may be smaller than the disc that was searched. The
  /// farthest particle itself is not counted, which makes the estimate unbiased on a plane (Loftsgaarden and
  /// Quesenberry 1965). With one or two particles its variance would be infinite; they are divided by the area that was
  /// searched.
  double irradiance(float reach2) const {
    if (count < 3 || radius2 <= 0) return flux / (std::numbers::pi * reach2);
    return flux * (1 - 1 / static_cast<double>(count)) / (std::numbers::pi * radius2);
  }
};

}  // namespace

class ParticleNeighbours::Tree {
 public:
  Tree(std::span<const Particle> particles, int count, float maxDistance)
      : count_(count), maxDistance2_(maxDistance * maxDistance), tree_(particles) {}

  float reach2() const { return maxDistance2_; }

  Tally collect(const Vec3& x, const Vec3& n, const Vec3& tangent, std::vector<WeightedPoint>& points) const {
    NearestSet nearest(tree_.particles(), n, count_, maxDistance2_);
    tree_.search(x, nearest);
    const Vec3 bitangent = n.cross(tangent);
    Tally tally;
    for (const NearestSet::Neighbour& neighbour : nearest.finish()) {
      const Particle& p = tree_.particles()[neighbour.index];
      const Vec3 local(p.direction.dot(tangent), p.direction.dot(bitangent), p.direction.dot(n));
      points.push_back({toDisc(local), p.weight});
      tally.radius2 = std::max(tally.radius2, neighbour.distance2);
      tally.weight += p.weight;
      tally.squares += static_cast<double>(p.weight) * p.weight;
      // A single 0, from a light that touches the surface, would make the harmonic mean 0.
      if (p.distance > 0) tally.inverseDistance += p.weight / p.distance;
      tally.flux += p.flux;
      ++tally.count;
    }
    return tally;
  }

 private:
  std::size_t count_;
  float maxDistance2_;
  ParticleTree tree_;
};

ParticleNeighbours::ParticleNeighbours(std::span<const std::span<const Particle>> sources, int count,
                                       float maxDistance) {
  std::vector<std::span<const Particle>> filled;
  std::ranges::copy_if(sources, std::back_inserter(filled), [](const auto& source) { return !source.empty(); });
  carryFlux_ = std::ranges::any_of(filled, [](const auto& source) {
    return std::ranges::any_of(source, [](const Particle& p) { return p.flux > 0; });
  });
  trees_.resize(filled.size());
  parallelFor(std::size_t{0}, filled.size(),
              [&](std::size_t i) { trees_[i] = std::make_unique<Tree>(filled[i], count, maxDistance); });
}

ParticleNeighbours::~ParticleNeighbours() = default;

Neighbourhood ParticleNeighbours::around(const Vec3& x, const Vec3& n, const Vec3& tangent) const {
  Neighbourhood all;
  double weight = 0, inverseDistance = 0, most = 0;
  for (const std::unique_ptr<Tree>& tree : trees_) {
    const std::size_t first = all.points.size();
    const Tally tally = tree->collect(x, n, tangent, all.points);
    const double effective = tally.effectiveSamples();
    // Of photons without weight, too, whose light only next-event estimation finds.
    all.irradiance += static_cast<float>(tally.irradiance(tree->reach2()));
    if (!(effective > 0)) continue;
    const double scale = effective / tally.weight;
    for (std::size_t i = first; i < all.points.size(); ++i)
      all.points[i].weight = static_cast<float>(all.points[i].weight * scale);
    weight += effective;
    inverseDistance += tally.inverseDistance * scale;
    if (effective > most) {
      most = effective;
      all.radius = std::sqrt(tally.radius2);
    }
  }
  if (inverseDistance > 0) all.distance = static_cast<float>(weight / inverseDistance);
  return all;
}

}  // namespace lobe
