// An invisible surface: all light passes straight through.

#include "materials/models.h"

namespace lobe {
namespace {

class Null final : public Bsdf {
 public:
  Rgb eval(const Vec3&, const Vec3&, const Vec2&) const override { return Rgb::Zero(); }
  std::optional<BsdfSample> sample(const Vec3&, const Vec2&, float, const Vec2&) const override { return std::nullopt; }
  float pdf(const Vec3&, const Vec3&, const Vec2&) const override { return 0.0f; }

  std::optional<DeltaSample> sampleDelta(const Vec3& wo, const Vec2&, float) const override {
    return DeltaSample{-wo, Rgb::Ones(), 1.0f};
  }
  std::optional<DeltaTransmission> deltaTransmission(const Vec3& wo, const Vec2&) const override {
    return DeltaTransmission{-wo, Rgb::Ones(), true};
  }
  float deltaProbability(const Vec3&, const Vec2&) const override { return 1.0f; }

  LobeMixture mixture(const Vec3&, const Vec2&) const override { return {}; }
  Rgb albedo(const Vec3&, const Vec2&) const override { return Rgb::Ones(); }
  bool transmits() const override { return true; }
};

}  // namespace

BsdfPtr makeNull(const Parameters&) {
  return std::make_shared<Null>();
}

}  // namespace lobe
