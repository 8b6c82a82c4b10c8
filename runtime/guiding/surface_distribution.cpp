#include "lobe/surface_distribution.h"

#include <algorithm>
#include <cassert>
#include <new>
#include <numbers>

#include "runtime/guiding/brdf_caches.h"
#include "runtime/guiding/conversions.h"
#include "runtime/guiding/surface_distribution_impl.h"

namespace lobe {
namespace {

constexpr float kInvPi = std::numbers::inv_pi_v<float>;

// A record is undersampled if it has seen fewer than five particles for each of eight components.
constexpr float kUndersampled = 40;
// Illumination is uniform if its background component has more than this weight: BSDF sampling equals the product then.
constexpr float kUniformBackground = 0.98f;

/// The rotation from the shading frame to the frame in which both factors of the product are given: its z axis is the
/// shading normal on the side of wo, its x axis the record's tangent made orthogonal to it. The record's mixture is
/// used without rotation, which is exact on flat surfaces.
Eigen::Matrix3f guidingAxes(const ShadingPoint& point, const PackedRecord& record, float side) {
  const Vec3 world = record.tangent();
  const Vec3 tangent(world.dot(toEigen(point.s)), world.dot(toEigen(point.t)), world.dot(toEigen(point.n)));
  const float length = tangent.head<2>().norm();
  const Vec2 x = length > 1e-4f ? Vec2(tangent.head<2>() / length) : Vec2(Vec2::UnitX());
  Eigen::Matrix3f axes;
  axes << x.x(), x.y(), 0, -side * x.y(), side * x.x(), 0, 0, 0, side;
  return axes;
}

/// Leaves the part of the BSDF that is not representable (transmission, lobes that are too narrow) to BSDF sampling.
StrategyProbabilities onRepresentable(const StrategyProbabilities& probabilities, float representable) {
  return {representable * probabilities.product,
          1 - representable * (probabilities.product + probabilities.illumination),
          representable * probabilities.illumination};
}

/// The nearest fraction in [0,1]; 1, so that only the BSDF is sampled, if it is not a number.
float toFraction(float x) {
  return x < 1 ? std::max(0.0f, x) : 1.0f;
}

/// The fraction of the described albedo that mixtures represent.
float representableFraction(const Reflectance& reflectance) {
  const float all = reflectance.albedo + reflectance.unrepresentableAlbedo;
  return all > 0 ? reflectance.albedo / all : 0.0f;
}

}  // namespace

GuidingDecision SurfaceDistribution::Impl::decide() const {
  if (record->samples == 0) return GuidingDecision::noRecord;
  if (representable <= 0) return GuidingDecision::tooNarrow;
  if (!product) return GuidingDecision::illumination;
  if (record->samples < kUndersampled) return GuidingDecision::undersampled;
  if (record->background > kUniformBackground) return GuidingDecision::uniform;
  return reflectance.gaussians.count() > 0 ? GuidingDecision::product : GuidingDecision::illumination;
}

void SurfaceDistribution::Impl::collectReflectance(const SurfaceReflectance& given, const BrdfCaches& caches) {
  reflectance.constant = given.diffuseAlbedo * kInvPi;
  reflectance.backgroundMass = reflectance.constant;
  reflectance.albedo = given.diffuseAlbedo;
  // On the back, lobes are evaluated in the frame (s, −t, −n). Two-sided materials use the mirrored frame (s, t, −n),
  // which is equivalent for lobes that are symmetric in t, as all of Lobe's are. For other lobes the density would be a
  // worse fit, but estimates would stay unbiased.
  const Vec3 above(wo.x(), side * wo.y(), side * wo.z());
  const Vec2 turn(axes(0, 0), axes(1, 0));
  for (const TintedLobe& lobe : given.lobes)
    if (lobe.tint > 0) caches.add(lobe.lobe, above, turn, lobe.tint, reflectance);
}

FractionSample SurfaceDistribution::Impl::fractionSample(const Vec3& wi, float bsdfPdf) const {
  // The probability of the mixtures, including the product's background term that is left to BSDF sampling.
  const float mixtureProbability = representable * (1 - record->bsdfFraction);
  const float background = density->bsdfFraction() - (1 - mixtureProbability);
  const float mixtureDensity =
      (std::max(0.0f, background) * bsdfPdf + density->guidedPdf(axes * wi)) / mixtureProbability;
  return {record->index, bsdfPdf, mixtureDensity, representable};
}

SurfaceDistribution::SurfaceDistribution(const Field& field, const ShadingPoint& point) {
  static_assert(kProductProbabilities.bsdf == kInitialBsdfFraction);
  static_assert(sizeof(Impl) <= kBytes && alignof(Impl) <= kAlignment && std::is_trivially_destructible_v<Impl>);
  const float side = sideOf(point);
  const PackedRecord* record = field.cache().find(toEigen(point.position), side * toEigen(point.normal));
  if (!record) return;
  hasRecord_ = true;
  // Default-initialised, so that the arrays of Gaussians are not zeroed.
  Impl& self = *new (storage_) Impl;
  self.wo = toEigen(point.wo);
  self.side = side;
  self.record.assign(*record);
  self.axes = guidingAxes(point, *record, side);
}

SurfaceDistribution::Impl& SurfaceDistribution::impl() {
  return *std::launder(reinterpret_cast<Impl*>(storage_));
}

const SurfaceDistribution::Impl& SurfaceDistribution::impl() const {
  return *std::launder(reinterpret_cast<const Impl*>(storage_));
}

std::uint32_t SurfaceDistribution::recordIndex() const {
  return impl().record->index;
}

void SurfaceDistribution::describe(const SurfaceReflectance& reflectance, const LobeCacheSet* caches) {
  if (!hasRecord_) return;
  Impl& self = impl();
  self.product = caches != nullptr;
  const float undescribed = toFraction(reflectance.undescribedFraction);
  self.described = undescribed == 0;
  if (self.product) self.collectReflectance(reflectance, *caches->caches_);
  self.representable = (1 - undescribed) * (self.product ? representableFraction(self.reflectance) : 1);
  assert(self.representable >= 0 && self.representable <= 1);
  decision_ = self.decide();
  if (decision_ == GuidingDecision::noRecord || decision_ == GuidingDecision::tooNarrow ||
      decision_ == GuidingDecision::uniform)
    return;
  const bool halves = !self.product || decision_ == GuidingDecision::undersampled;
  const StrategyProbabilities probabilities =
      halves ? kGuidedProbabilities : productProbabilities(self.record->bsdfFraction);
  self.density.emplace(self.reflectance, *self.record, onRepresentable(probabilities, self.representable));
  bsdfProbability_ = self.density->bsdfFraction();
  productOfGuided_ = self.density->productOfGuided();
}

std::optional<GuidedSample> SurfaceDistribution::sample(Strategy strategy, float choice, const Float2& u) const {
  if (bsdfProbability_ >= 1) return std::nullopt;
  const Impl& self = impl();
  const std::optional<Vec3> guided = self.density->sample(strategy, choice, toEigen(u));
  if (!guided) return std::nullopt;
  return GuidedSample{toFloats(Vec3(self.axes.transpose() * *guided)), self.density->guidedPdf(*guided)};
}

float SurfaceDistribution::guidedPdf(const Float3& wi) const {
  if (bsdfProbability_ >= 1) return 0;
  const Impl& self = impl();
  return self.density->guidedPdf(self.axes * toEigen(wi));
}

std::optional<float> SurfaceDistribution::reflectedRadiance(float albedo) const {
  if (!hasRecord_) return std::nullopt;
  const Impl& self = impl();
  // The radiance reflected by lobes without a cache, and transmitted radiance, cannot be estimated.
  if (!(self.record->irradiance > 0) || !self.described) return std::nullopt;
  if (!self.product) return self.record->irradiance * albedo * kInvPi;
  const bool shaped = decision_ == GuidingDecision::product || decision_ == GuidingDecision::illumination;
  return self.record->irradiance * (self.reflectance.unrepresentableAlbedo * kInvPi +
                                    (shaped ? self.density->reflected() : self.reflectance.backgroundMass));
}

bool SurfaceDistribution::learnsFraction() const {
  return decision_ == GuidingDecision::product || (decision_ == GuidingDecision::illumination && impl().product);
}

}  // namespace lobe
