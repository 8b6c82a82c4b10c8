#include "runtime/render/gradients/offset_path.h"

#include <cmath>

#include "runtime/core/sampling.h"

namespace lobe {

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
  // Components have intervals of `choice` in their order. The first and the last are the most frequent.
  float low = 0.0f, high = kOneMinusEpsilon;
  for (const float choice : {low, high}) {
    std::optional<DeltaSample> sample = sampleDelta(hit, choice);
    if (sample && sample->component == component) return sample;
  }
  constexpr int kSteps = 24;
  for (int i = 0; i < kSteps; ++i) {
    const float middle = 0.5f * (low + high);
    std::optional<DeltaSample> sample = sampleDelta(hit, middle);
    if (!sample || sample->component == component) return sample;
    (sample->component < component ? low : high) = middle;
  }
  return std::nullopt;
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
