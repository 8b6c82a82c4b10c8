// Bump mapping: uses the shading normal that the surface would have if a texture displaced it along its normal.

#include <Eigen/Geometry>

#include "materials/adapters/normal_mapping.h"
#include "materials/models.h"

namespace lobe {
namespace {

/// Half the step of the finite differences, in texture coordinates: smaller than a texel of all but the largest
/// textures, and far larger than the rounding error of coordinates of a few units.
constexpr float kHalfStep = 0x1p-13f;

class BumpMap final : public NormalMapping {
 public:
  BumpMap(BsdfPtr nested, const Options& options, TexturePtr displacement, float scale)
      : NormalMapping(std::move(nested), options), displacement_(std::move(displacement)), scale_(scale) {}

 private:
  std::optional<Tilted> tilted(const Vec2& uv, const Vec3& dpdu, const Vec3& dpdv) const override {
    // The displaced position is p + h(u,v) z. Its derivatives, without the curvature of the base surface, span the new
    // tangent plane.
    const Vec3 du(dpdu.x(), dpdu.y(), derivative(uv, Vec2(kHalfStep, 0.0f)));
    const Vec3 dv(dpdv.x(), dpdv.y(), derivative(uv, Vec2(0.0f, kHalfStep)));
    // In double precision, because the squared norm has the fourth power of lengths at the scale of the scene.
    const Eigen::Vector3d cross = du.cast<double>().cross(dv.cast<double>());
    const double length = cross.norm();
    if (!(length > 0.0) || cross.z() == 0.0) return std::nullopt;
    const Vec3 normal =
        (cross / (cross.z() > 0.0 ? length : -length)).cast<float>();  // mirrored texture coordinates flip it
    return Tilted{normal, du, dv};
  }

  /// Central difference of the displacement, divided by the step as rounded in floating point.
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
  return std::make_shared<BumpMap>(parameters.onlyChild(), NormalMapping::readOptions(parameters),
                                   parameters.onlyTexture(), static_cast<float>(parameters.number("scale", 1.0)));
}

}  // namespace lobe
