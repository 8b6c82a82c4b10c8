#include "runtime/render/lights/light_tree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "runtime/core/sampling.h"

namespace lobe {
namespace {

float angleOf(float cosine) {
  return std::acos(std::clamp(cosine, -1.0f, 1.0f));
}

struct Cone {
  Vec3 axis;
  float cosine;
};

/// The smallest cone that contains two cones.
Cone merged(const Cone& a, const Cone& b) {
  const Cone& wide = a.cosine <= b.cosine ? a : b;
  const Cone& narrow = a.cosine <= b.cosine ? b : a;
  const float wideAngle = angleOf(wide.cosine), narrowAngle = angleOf(narrow.cosine);
  const float between = angleOf(wide.axis.dot(narrow.axis));
  if (between + narrowAngle <= wideAngle) return wide;
  // Slightly wider, so that rounding errors do not exclude a normal.
  const float angle = 0.5f * (wideAngle + between + narrowAngle) + 1e-3f;
  if (angle >= kPi) return {wide.axis, -1.0f};
  const Vec3 turn = wide.axis.cross(narrow.axis);
  if (!(turn.norm() > 1e-6f)) return between < 1.0f ? Cone{wide.axis, std::cos(angle)} : Cone{wide.axis, -1.0f};
  const Vec3 axis = Eigen::AngleAxisf(angle - wideAngle, turn.normalized()) * wide.axis;
  return {axis.normalized(), std::cos(angle)};
}

/// The solid angle into which the lights shine, weighted by the cosine outside of the cone of normals (Conty Estevez
/// and Kulla 2018, Eq. 1).
double orientationMeasure(const LightBounds& b) {
  const double normal = angleOf(b.normalCosine), emission = angleOf(b.emissionCosine);
  const double reach = std::min(normal + emission, std::numbers::pi);
  const double sine = std::sin(normal);
  return 2 * std::numbers::pi * (1 - std::cos(normal)) +
         std::numbers::pi / 2 *
             (2 * reach * sine - std::cos(normal - 2 * reach) - 2 * normal * sine + std::cos(normal));
}

/// The cost of a node in the choice of a split: its power spread over area and orientation. The squared diagonal stands
/// for the area, which is zero for lights on a line.
double costOf(const LightBounds& b) {
  return b.box.isEmpty() ? 0 : b.power * orientationMeasure(b) * b.box.diagonal().squaredNorm();
}

using Iterator = std::vector<int>::iterator;

/// A plane that splits lights by their centres.
struct Split {
  int axis = -1;
  float position = 0;
  double cost = std::numeric_limits<double>::infinity();
};

Vec3 centreOf(const LightBounds& b) {
  return b.box.center();
}

constexpr int kBins = 12;

void considerAxis(const std::vector<LightBounds>& lights, Iterator first, Iterator last, int axis,
                  const Eigen::AlignedBox3f& centres, Split& best) {
  const float low = centres.min()[axis], extent = centres.max()[axis] - low;
  if (!(extent > 0)) return;
  std::array<LightBounds, kBins> bins;
  for (Iterator i = first; i != last; ++i) {
    const float place = (centreOf(lights[*i])[axis] - low) / extent;
    LightBounds& bin = bins[std::min(static_cast<int>(place * kBins), kBins - 1)];
    bin = merged(bin, lights[*i]);
  }
  std::array<double, kBins> below{};
  LightBounds sum;
  for (int i = 0; i + 1 < kBins; ++i) below[i] = costOf(sum = merged(sum, bins[i]));
  sum = {};
  for (int i = kBins - 1; i > 0; --i) {
    sum = merged(sum, bins[i]);
    // A long node is split along its length.
    const double cost = (below[i - 1] + costOf(sum)) * centres.diagonal().maxCoeff() / extent;
    if (cost < best.cost) best = {axis, low + extent * static_cast<float>(i) / kBins, cost};
  }
}

/// Splits [first, last), which holds at least two lights.
Iterator partition(const std::vector<LightBounds>& lights, Iterator first, Iterator last) {
  Eigen::AlignedBox3f centres;
  for (Iterator i = first; i != last; ++i) centres.extend(centreOf(lights[*i]));
  Split best;
  for (int axis = 0; axis < 3; ++axis) considerAxis(lights, first, last, axis, centres, best);
  const Iterator half = first + (last - first) / 2;
  if (best.axis < 0) return half;
  const Iterator middle =
      std::partition(first, last, [&](int i) { return centreOf(lights[i])[best.axis] < best.position; });
  return middle == first || middle == last ? half : middle;
}

/// cos(max(0, a − b)) for angles in [0, π], given by their cosines and sines.
float cosineOfDifference(float cosA, float sinA, float cosB, float sinB) {
  return cosA > cosB ? 1.0f : cosA * cosB + sinA * sinB;
}
float sineOf(float cosine) {
  return std::sqrt(std::max(0.0f, 1.0f - cosine * cosine));
}

}  // namespace

LightBounds merged(const LightBounds& a, const LightBounds& b) {
  if (a.box.isEmpty()) return b;
  if (b.box.isEmpty()) return a;
  const Cone cone = merged(Cone{a.axis, a.normalCosine}, Cone{b.axis, b.normalCosine});
  return {a.box.merged(b.box), cone.axis, cone.cosine, std::min(a.emissionCosine, b.emissionCosine), a.power + b.power};
}

LightTree::LightTree(const std::vector<LightBounds>& lights) : leafOf_(lights.size(), -1) {
  std::vector<int> shining;
  for (std::size_t i = 0; i < lights.size(); ++i) {
    if (!(lights[i].power > 0) || lights[i].box.isEmpty()) continue;
    shining.push_back(static_cast<int>(i));
    total_ += lights[i].power;
  }
  if (!shining.empty()) build(lights, shining.begin(), shining.end(), -1);
}

int LightTree::build(const std::vector<LightBounds>& lights, Iterator first, Iterator last, int parent) {
  LightBounds bounds;
  for (Iterator i = first; i != last; ++i) bounds = merged(bounds, lights[*i]);
  const auto index = static_cast<int>(nodes_.size());
  const float radius = 0.5f * bounds.box.diagonal().norm();
  nodes_.push_back({bounds.box.center(), radius * radius, bounds.axis, bounds.normalCosine, bounds.emissionCosine,
                    static_cast<float>(bounds.power / total_), parent, 0, *first});
  if (last - first == 1) {
    leafOf_[*first] = index;
    return index;
  }
  const Iterator middle = partition(lights, first, last);
  build(lights, first, middle, index);
  const int right = build(lights, middle, last, index);
  nodes_[index].right = right;
  return index;
}

std::optional<std::pair<int, int>> LightTree::children(int node) const {
  if (nodes_[node].right == 0) return std::nullopt;
  return std::pair(node + 1, nodes_[node].right);
}

float LightTree::radius(int node) const {
  return std::sqrt(nodes_[node].radius2);
}

std::vector<int> LightTree::lightsOf(int node) const {
  const auto below = children(node);
  if (!below) return {nodes_[node].light};
  std::vector<int> lights = lightsOf(below->first);
  const std::vector<int> right = lightsOf(below->second);
  lights.insert(lights.end(), right.begin(), right.end());
  return lights;
}

// The angles are those of the paper's Section 3.2: the uncertainty is the half angle of the sphere around the lights.
float LightTree::importance(int node, const LightReceiver& at) const {
  const Node& n = nodes_[node];
  const Vec3 towards = n.centre - at.position;
  const float distance2 = towards.squaredNorm();
  const float least = std::max(n.radius2, std::numeric_limits<float>::min());
  if (distance2 <= least) return n.power / least;
  const Vec3 wi = towards / std::sqrt(distance2);
  const float sin2Spread = n.radius2 / distance2;
  const float cosSpread = std::sqrt(1.0f - sin2Spread), sinSpread = std::sqrt(sin2Spread);

  const float cosAxis = std::clamp(-n.axis.dot(wi), -1.0f, 1.0f);
  const float cosOutside = cosineOfDifference(cosAxis, sineOf(cosAxis), n.normalCosine, sineOf(n.normalCosine));
  const float cosLeast = cosineOfDifference(cosOutside, sineOf(cosOutside), cosSpread, sinSpread);
  // A little more than zero, because rounding must not exclude a light.
  if (cosLeast < n.emissionCosine - 1e-4f) return 0.0f;
  float result = n.power * std::max(cosLeast, 1e-4f) / distance2;
  if (at.normal != Vec3::Zero()) {
    const float cosReceived = std::clamp(at.normal.dot(wi), -1.0f, 1.0f);
    const float cosHighest = cosineOfDifference(cosReceived, sineOf(cosReceived), cosSpread, sinSpread);
    if (cosHighest < -1e-4f) return 0.0f;
    result *= std::max(cosHighest, 1e-4f);
  }
  return result;
}

float LightTree::leftProbability(int node, float left, float right) const {
  float fraction = left / (left + right);
  if (!std::isfinite(fraction)) fraction = nodes_[node + 1].power / nodes_[node].power;
  // The estimates of large nodes are inaccurate.
  constexpr float kLeast = 1e-3f;
  return left > 0.0f && right > 0.0f ? std::clamp(fraction, kLeast, 1.0f - kLeast) : fraction;
}

std::optional<LightTree::Choice> LightTree::sample(int node, const LightReceiver& at, double& choice) const {
  constexpr double kMost = 1 - std::numeric_limits<double>::epsilon() / 2;
  float probability = 1;
  while (nodes_[node].right != 0) {
    const float left = importance(node + 1, at), right = importance(nodes_[node].right, at);
    if (!(left + right > 0)) return std::nullopt;
    const float toLeft = leftProbability(node, left, right);
    if (choice < toLeft) {
      choice = std::min(choice / toLeft, kMost);
      probability *= toLeft;
      node = node + 1;
    } else {
      choice = std::min((choice - toLeft) / (1.0 - toLeft), kMost);
      probability *= 1 - toLeft;
      node = nodes_[node].right;
    }
  }
  if (!(probability > 0)) return std::nullopt;
  return Choice{nodes_[node].light, probability};
}

float LightTree::probability(int node, const LightReceiver& at, int light) const {
  float probability = 1;
  for (int below = leafOf_[light]; below != node; below = nodes_[below].parent) {
    const int parent = nodes_[below].parent;
    const float left = importance(parent + 1, at), right = importance(nodes_[parent].right, at);
    if (!(left + right > 0)) return 0.0f;
    const float toLeft = leftProbability(parent, left, right);
    probability *= below == parent + 1 ? toLeft : 1 - toLeft;
  }
  return probability;
}

}  // namespace lobe
