#include "runtime/mixture/lookup.h"

#include <algorithm>

namespace lobe {
namespace {

/// The unit vector of wo's azimuth; the x axis if wo is the normal.
Vec2 azimuthOf(const Vec3& wo) {
  const float length = wo.head<2>().norm();
  return length > 0 ? Vec2(wo.head<2>() / length) : Vec2::UnitX();
}

/// The largest t ≤ 1 with |mean + t·step| ≤ 1 for a mean inside the disc; 1 for a mean outside.
float largestStep(const Vec2& mean, const Vec2& step) {
  const float room = 1.0f - mean.squaredNorm();
  const float length2 = step.squaredNorm();
  if (room <= 0 || !(length2 > 0)) return 1.0f;
  const float along = mean.dot(step);
  const float t = (std::sqrt(along * along + length2 * room) - along) / length2;
  return std::clamp(t, 0.0f, 1.0f);
}

Gaussian mirrored(Gaussian g, const Mirror& mirror) {
  if (mirror.x) g.meanX = -g.meanX;
  if (mirror.y) g.meanY = -g.meanY;
  if (mirror.x != mirror.y) g.cov.xy = -g.cov.xy;
  return g;
}

}  // namespace

std::span<Gaussian> alignMixture(const Alignment& alignment, std::span<const Gaussian> components, const Vec3& wo,
                                 std::span<Gaussian> out) {
  out = out.first(components.size());
  Vec2 reference = alignment.reference;
  if (alignment.kind == GridKind::elevation) {
    const Vec2 azimuth = azimuthOf(wo);
    reference = azimuth * reference.x();  // elevations lie on the positive x axis
    for (std::size_t k = 0; k < out.size(); ++k) out[k] = rotated(components[k], azimuth);
  } else {
    if (alignment.mirror.x) reference.x() = -reference.x();
    if (alignment.mirror.y) reference.y() = -reference.y();
    for (std::size_t k = 0; k < out.size(); ++k) out[k] = mirrored(components[k], alignment.mirror);
  }
  const Vec2 step = reference - toDisc(wo);
  for (Gaussian& g : out) {
    // Shortened per component: a broad component at the edge, which fits a tail, must not stop the others.
    const float t = largestStep(g.mean(), step);
    g.meanX += t * step.x();
    g.meanY += t * step.y();
  }
  return out;
}

Placement placementOf(const Alignment& alignment, const Vec3& wo) {
  Placement p;
  const Vec2& reference = alignment.reference;
  const Vec2 to = toDisc(wo);
  if (alignment.kind == GridKind::elevation) {
    // The step is along x at azimuth 0; the rotation to wo's azimuth is applied last.
    const Vec2 azimuth = azimuthOf(wo);
    p.stepX = reference.x() - to.norm();
    p.cosine = azimuth.x();
    p.sine = azimuth.y();
  } else {
    p.mirrorX = alignment.mirror.x ? -1.0f : 1.0f;
    p.mirrorY = alignment.mirror.y ? -1.0f : 1.0f;
    p.stepX = p.mirrorX * reference.x() - to.x();
    p.stepY = p.mirrorY * reference.y() - to.y();
  }
  return p;
}

}  // namespace lobe
