// Takes the shading normal from a texture: 2·rgb − 1 in the frame of the base normal z and the tangent along u.

#include "materials/frame.h"
#include "materials/models.h"
#include "materials/nested_bsdf.h"

namespace lobe {
namespace {

class NormalMap final : public NestedBsdf {
 public:
  NormalMap(BsdfPtr nested, TexturePtr normals) : NestedBsdf(std::move(nested)), normals_(std::move(normals)) {}

  Vec3 perturbedNormal(const Vec2& uv, const Vec3& dpdu, const Vec3& dpdv) const override {
    const Vec3 mapped = (2.0f * normals_->eval(uv) - 1.0f).matrix();
    const float length = mapped.norm();
    // A normal that looks below the surface, or nowhere, is a fault of the image: the base normal stands in.
    if (!(length > 0.0f && mapped.z() > 0.0f)) return nested().perturbedNormal(uv, dpdu, dpdv);
    const Vec3 normal = Frame::fromTangent(Vec3::UnitZ(), dpdu).toWorld(mapped / length);
    const Frame frame = Frame::fromTangent(normal, dpdu);
    return frame.toWorld(nested().perturbedNormal(uv, frame.toLocal(dpdu), frame.toLocal(dpdv)));
  }

 private:
  TexturePtr normals_;
};

}  // namespace

BsdfPtr makeNormalMap(const Parameters& parameters) {
  return std::make_shared<NormalMap>(parameters.onlyChild(), parameters.onlyTexture());
}

}  // namespace lobe
