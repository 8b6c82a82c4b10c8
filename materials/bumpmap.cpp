// Turns the shading normal as if the surface were displaced along it by a texture.

#include "materials/frame.h"
#include "materials/models.h"
#include "materials/nested_bsdf.h"

namespace lobe {
namespace {

/// Half the step of the differences, in texture coordinates: within a texel of all but the largest textures, and far
/// above the rounding of coordinates of a few units.
constexpr float kHalfStep = 0x1p-13f;

class BumpMap final : public NestedBsdf {
 public:
  BumpMap(BsdfPtr nested, TexturePtr displacement, float scale)
      : NestedBsdf(std::move(nested)), displacement_(std::move(displacement)), scale_(scale) {}

  Vec3 perturbedNormal(const Vec2& uv, const Vec3& dpdu, const Vec3& dpdv) const override {
    // The displaced position is p + h(u,v) z; its derivatives, curvature of the base left out, span the new tangent
    // plane.
    const Vec3 du(dpdu.x(), dpdu.y(), derivative(uv, Vec2(kHalfStep, 0.0f)));
    const Vec3 dv(dpdv.x(), dpdv.y(), derivative(uv, Vec2(0.0f, kHalfStep)));
    const Vec3 cross = du.cross(dv);
    const float length = cross.norm();
    if (!(length > 0.0f) || cross.z() == 0.0f) return nested().perturbedNormal(uv, dpdu, dpdv);
    const Vec3 normal = cross / (cross.z() > 0.0f ? length : -length);  // mirrored coordinates turn it over
    const Frame frame = Frame::fromTangent(normal, du);
    return frame.toWorld(nested().perturbedNormal(uv, frame.toLocal(du), frame.toLocal(dv)));
  }

 private:
  /// By central differences of the displacement's luminance, over the step as it came out in floating point.
  float derivative(const Vec2& uv, const Vec2& halfStep) const {
    const Vec2 ahead = uv + halfStep;
    const Vec2 behind = uv - halfStep;
    const float step = (ahead - behind).sum();
    return step > 0.0f ? scale_ * (height(ahead) - height(behind)) / step : 0.0f;
  }
  float height(const Vec2& uv) const { return displacement_->evalNumber(uv); }

  TexturePtr displacement_;
  float scale_;
};

}  // namespace

BsdfPtr makeBumpMap(const Parameters& parameters) {
  return std::make_shared<BumpMap>(parameters.onlyChild(), parameters.onlyTexture(),
                                   static_cast<float>(parameters.number("scale", 1.0)));
}

}  // namespace lobe
