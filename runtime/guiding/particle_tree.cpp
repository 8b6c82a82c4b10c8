#include "runtime/guiding/particle_tree.h"

#include <algorithm>

#include <Eigen/Geometry>

#include "runtime/core/parallel.h"

namespace lobe {
namespace {

// Levels whose nodes are split in parallel; below them, each subtree is split by one thread.
constexpr int kParallelLevels = 6;

}  // namespace

ParticleTree::ParticleTree(std::span<const Particle> particles) : particles_(particles.size()) {
  while (particles.size() > kLeafSize << levels_) ++levels_;
  splits_.resize((std::size_t{1} << levels_) - 1);
  std::vector<Point> points(particles.size());
  parallelFor(std::size_t{0}, points.size(), [&](std::size_t i) {
    points[i] = {particles[i].position, static_cast<std::uint32_t>(i)};
  });
  const int top = std::min(levels_, kParallelLevels);
  for (int level = 0; level < top; ++level)
    parallelFor(std::size_t{0}, std::size_t{1} << level, [&](std::size_t i) { split({level, i}, points); });
  parallelFor(std::size_t{0}, std::size_t{1} << top, [&](std::size_t i) { splitAll({top, i}, points); });
  parallelFor(std::size_t{0}, points.size(), [&](std::size_t i) { particles_[i] = particles[points[i].particle]; });
}

// Splits the widest axis at the median.
void ParticleTree::split(Node node, std::span<Point> points) {
  const std::size_t first = begin(node), middle = end({node.level + 1, 2 * node.index});
  const std::span<Point> own = points.subspan(first, end(node) - first);
  Eigen::AlignedBox3f bounds;
  for (const Point& p : own) bounds.extend(p.position);
  Eigen::Index axis;
  bounds.diagonal().maxCoeff(&axis);
  const auto median = own.begin() + static_cast<std::ptrdiff_t>(middle - first);
  std::nth_element(own.begin(), median, own.end(),
                   [axis](const Point& a, const Point& b) { return a.position[axis] < b.position[axis]; });
  splitOf(node) = {static_cast<int>(axis), median->position[axis]};
}

void ParticleTree::splitAll(Node node, std::span<Point> points) {
  if (node.level == levels_) return;
  split(node, points);
  splitAll({node.level + 1, 2 * node.index}, points);
  splitAll({node.level + 1, 2 * node.index + 1}, points);
}

}  // namespace lobe
