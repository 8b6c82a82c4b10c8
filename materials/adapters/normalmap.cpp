// Normal mapping: the shading normal is 2·rgb − 1 of a texture, in the frame of the base normal (z) and the tangent
// along u.

#include "materials/adapters/normal_mapping.h"
#include "materials/models.h"
#include "runtime/core/frame.h"

namespace lobe {
namespace {

class NormalMap final : public NormalMapping {
 public:
  NormalMap(BsdfPtr nested, const Options& options, TexturePtr normals)
      : NormalMapping(std::move(nested), options), normals_(std::move(normals)) {}

 private:
  std::optional<Tilted> tilted(const Vec2& uv, const Vec3& dpdu, const Vec3& dpdv) const override {
    const Vec3 mapped = (2.0f * normals_->eval(uv) - 1.0f).matrix();
    const float length = mapped.norm();
    // Normals that point below the surface or have length zero are invalid; the base normal replaces them.
    if (!(length > 0.0f && mapped.z() > 0.0f)) return std::nullopt;
    return Tilted{Frame::fromTangent(Vec3::UnitZ(), dpdu).toWorld(mapped / length), dpdu, dpdv};
  }

  TexturePtr normals_;
};

}  // namespace

BsdfPtr makeNormalMap(const Parameters& parameters) {
  return std::make_shared<NormalMap>(parameters.onlyChild(), NormalMapping::readOptions(parameters),
                                     parameters.onlyTexture());
}

}  // namespace lobe
