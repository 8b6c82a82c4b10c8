#pragma once
// Internal to materials/: the reflection of a rough interface as a lobe. Subclasses define the Fresnel term.

#include <string>

#include "materials/lobe.h"
#include "materials/lobes/microfacet.h"

namespace lobe {

/// D G F / (4 cosθo cosθi), where the subclass defines F.
class MicrofacetLobe : public Lobe {
 public:
  explicit MicrofacetLobe(const Microfacet& microfacet) : microfacet_(microfacet) {}

  LobeKind kind() const final;
  bool mirrorSymmetric() const final { return true; }
  std::string model() const final;
  std::string key() const final;
  std::string summary() const final;
  int revision() const final { return 1; }
  double eval(const Vec3& wo, const Vec3& wi) const final;
  std::optional<LobeSample> sample(const Vec3& wo, const Vec2& u) const final;
  float pdf(const Vec3& wo, const Vec3& wi) const final;

  const Microfacet& microfacet() const { return microfacet_; }

 protected:
  virtual std::string interfaceName() const = 0;     ///< suffix of model()
  virtual std::string interfaceKey() const = 0;      ///< suffix of key(): everything F depends on
  virtual std::string interfaceSummary() const = 0;  ///< suffix of summary()
  /// The Fresnel term F in luminance, in [0,1].
  virtual double reflectance(double cosHalf) const = 0;

 private:
  Microfacet microfacet_;
};

}  // namespace lobe
