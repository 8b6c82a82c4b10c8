// Interpolates between two models with a weight from a texture.

#include <algorithm>

#include <fmt/format.h>

#include "materials/adapters/weighted_bsdf.h"
#include "materials/models.h"

namespace lobe {
namespace {

class Blend final : public WeightedBsdf {
 public:
  Blend(const std::vector<BsdfPtr>& parts, TexturePtr weight) : WeightedBsdf(parts), weight_(std::move(weight)) {}

 private:
  PartWeights weights(const Vec2& uv) const override {
    const float second = std::clamp(weight_->evalNumber(uv), 0.0f, 1.0f);
    return {1.0f - second, second};
  }

  TexturePtr weight_;
};

}  // namespace

BsdfPtr makeBlend(const Parameters& parameters) {
  const std::vector<BsdfPtr>& parts = parameters.children();
  if (parts.size() != 2)
    throw ParameterError("", fmt::format("blendbsdf needs two nested bsdfs, but there are {}", parts.size()));
  return std::make_shared<Blend>(parts, parameters.texture("weight", grey(0.5f)));
}

}  // namespace lobe
