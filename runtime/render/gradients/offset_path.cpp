#include "runtime/render/gradients/offset_path.h"

#include <cmath>

#include "runtime/core/sampling.h"

namespace lobe {
namespace {

/// Components of the delta part have intervals of `choice` in their order. Some intervals may have no sample, such as
/// that of metal seen from behind: whether the component that is sought is below or above is then not known, and both
/// sides are searched.
class ComponentSearch {
 public:
  struct Point {
    float choice;
    std::optional<DeltaSample> sample;
  };

  ComponentSearch(const SurfaceHit& hit, double component) : hit_(hit), component_(component) {}

  Point at(float choice) const { return {choice, sampleDelta(hit_, choice)}; }
  bool isSought(const Point& point) const { return point.sample && point.sample->component == component_; }

  /// Bisects an interval, after `depth` bisections, at whose ends the component is not.
  std::optional<DeltaSample> between(const Point& low, const Point& high, int depth) const {
    if (!mayContain(low, high, depth)) return std::nullopt;
    const Point middle = at(0.5f * (low.choice + high.choice));
    if (isSought(middle)) return middle.sample;
    std::optional<DeltaSample> found = between(low, middle, depth + 1);
    return found ? found : between(middle, high, depth + 1);
  }

 private:
  static constexpr int kMostDepth = 24;
  static constexpr int kMostDepthWithoutSamples = 6;  // bounds the number of all bisections

  bool mayContain(const Point& low, const Point& high, int depth) const {
    if (low.sample && low.sample->component > component_) return false;
    if (high.sample && high.sample->component < component_) return false;
    return depth < (low.sample || high.sample ? kMostDepth : kMostDepthWithoutSamples);
  }

  const SurfaceHit& hit_;
  double component_;
};

}  // namespace

bool scattersBroadly(const SurfaceHit& hit, const Rgb& f) {
  return luminance(f) * kPi <= kBroad * luminance(hit.bsdf->albedo(hit.wo, hit.uv));
}

bool connectable(const SurfaceHit& hit) {
  return hit.emitter || !hit.bsdf || hit.bsdf->deltaProbability(hit.wo, hit.uv) < 1.0f;
}

bool correspond(const SurfaceHit& base, const Vec3& baseWi, const SurfaceHit& offset, const Vec3& offsetWi) {
  const bool reflects = base.wo.z() * baseWi.z() > 0.0f;
  if (reflects != (offset.wo.z() * offsetWi.z() > 0.0f)) return false;
  return reflects || (base.material == offset.material && base.wo.z() * offset.wo.z() > 0.0f);
}

float connectionJacobian(const Vec3& normal, const Vec3& base, const Vec3& offset) {
  const float ratio = base.norm() / offset.norm();
  return std::abs(normal.dot(offset) / normal.dot(base)) * ratio * ratio * ratio;
}

std::optional<DeltaSample> deltaComponent(const SurfaceHit& hit, double component) {
  if (!(hit.bsdf->deltaProbability(hit.wo, hit.uv) > 0.0f)) return std::nullopt;
  const ComponentSearch search(hit, component);
  // The first and the last component are the most frequent.
  const ComponentSearch::Point low = search.at(0.0f);
  if (search.isSought(low)) return low.sample;
  const ComponentSearch::Point high = search.at(kOneMinusEpsilon);
  if (search.isSought(high)) return high.sample;
  return search.between(low, high, 0);
}

void OffsetPath::scale(const Rgb& contribution, float density) {
  throughput *= contribution;
  ratio *= density;
  if (!(throughput.maxCoeff() > 0.0f && ratio > 0.0f)) fail();
}

Rgb weightedDifference(const Contribution& base, const std::optional<Contribution>& offset) {
  const bool paired = offset && offset->value.maxCoeff() > 0.0f && offset->group2 > 0.0;
  if (!paired) return base.weighted();
  // Squared densities overflow where the other techniques find such paths practically always.
  if (!std::isfinite(base.total2) || !std::isfinite(offset->total2)) return Rgb::Zero();
  const double ways = base.group2 + offset->group2;
  return base.value * static_cast<float>(base.group2 / base.total2 / ways) -
         offset->value * static_cast<float>(offset->group2 / offset->total2 / ways);
}

Rgb weightedDifference(Contribution base, std::optional<Contribution> offset, bool sameShift) {
  if (sameShift) {
    base.group2 = base.total2;
    if (offset) offset->group2 = offset->total2;
  }
  return weightedDifference(base, offset);
}

}  // namespace lobe
