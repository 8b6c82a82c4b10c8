#pragma once
// A k-d tree of particles for searches of the particles near a point.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/guiding/particle.h"

namespace lobe {

/// A balanced k-d tree (Bentley 1975). It holds copies of the particles in the order of its leaves, so that a search
/// reads adjacent memory. The order depends on the particles alone, not on threads.
class ParticleTree {
 public:
  /// Builds the tree in parallel.
  explicit ParticleTree(std::span<const Particle> particles);

  /// The particles in the order of the leaves.
  std::span<const Particle> particles() const { return particles_; }

  /// Calls found.add(distance², index into particles()) for particles near x, nearest leaves first, and among them for
  /// every particle whose squared distance is below found.reach2() at the time, which may decrease during the search.
  template <class Found>
  void search(const Vec3& x, Found& found) const {
    Vec3 offset = Vec3::Zero();
    search({0, 0}, x, offset, 0.0f, found);
  }

 private:
  static constexpr std::size_t kLeafSize = 16;  // largest number of particles in a leaf

  /// Node `index` of the 2^level nodes of a level.
  struct Node {
    int level;
    std::size_t index;
  };
  struct Split {
    int axis;
    float position;
  };
  struct Point {
    Vec3 position;
    std::uint32_t particle;  // index in the order given to the constructor
  };

  std::size_t begin(Node node) const { return particles_.size() * node.index >> node.level; }
  std::size_t end(Node node) const { return particles_.size() * (node.index + 1) >> node.level; }
  Split& splitOf(Node node) { return splits_[(std::size_t{1} << node.level) - 1 + node.index]; }
  const Split& splitOf(Node node) const { return splits_[(std::size_t{1} << node.level) - 1 + node.index]; }
  void split(Node node, std::span<Point> points);
  void splitAll(Node node, std::span<Point> points);

  // offset: vector from x to the node's cell along the axes that x lies outside of; distance2: its squared length.
  template <class Found>
  void search(Node node, const Vec3& x, Vec3& offset, float distance2, Found& found) const {
    if (node.level == levels_) {
      for (std::size_t i = begin(node); i < end(node); ++i) {
        const float d2 = (particles_[i].position - x).squaredNorm();
        if (d2 < found.reach2()) found.add(d2, static_cast<std::uint32_t>(i));
      }
      return;
    }
    const Split& split = splitOf(node);
    const float beyond = x[split.axis] - split.position, before = offset[split.axis];
    const std::size_t near = 2 * node.index + (beyond >= 0 ? 1 : 0);
    search({node.level + 1, near}, x, offset, distance2, found);
    const float farther2 = distance2 - before * before + beyond * beyond;
    if (!(farther2 < found.reach2())) return;
    offset[split.axis] = beyond;
    search({node.level + 1, near ^ 1}, x, offset, farther2, found);
    offset[split.axis] = before;
  }

  int levels_ = 0;  // of inner nodes
  std::vector<Split> splits_;
  std::vector<Particle> particles_;
};

}  // namespace lobe
