#include "materials/adapters/normal_mapping.h"

#include "runtime/core/frame.h"

namespace lobe {

NormalMapping::Options NormalMapping::readOptions(const Parameters& parameters) {
  return {parameters.flag("flip_invalid_normals", false), parameters.flag("use_shadowing_function", false)};
}

Vec3 NormalMapping::perturbedNormal(const Vec3& wo, const Vec2& uv, const Vec3& dpdu, const Vec3& dpdv) const {
  const std::optional<Tilted> surface = tilted(uv, dpdu, dpdv);
  if (!surface) return nested_->perturbedNormal(wo, uv, dpdu, dpdv);
  Vec3 normal = surface->normal;
  if (options_.flipInvalid && wo.z() * wo.dot(normal) <= 0.0f) normal.head<2>() *= -1.0f;
  const Frame frame = Frame::fromTangent(normal, surface->dpdu);
  return frame.toWorld(
      nested_->perturbedNormal(frame.toLocal(wo), uv, frame.toLocal(surface->dpdu), frame.toLocal(surface->dpdv)));
}

float terminatorRoughness2(float cosine) {
  const float cosine2 = cosine * cosine;
  return cosine2 > 0.0f ? std::min(1.0f, 0.125f * (1.0f - cosine2) / cosine2) : 1.0f;
}

}  // namespace lobe
