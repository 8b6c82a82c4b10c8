#include "lobe/surface_distribution.h"

#include <algorithm>
#include <new>
#include <numbers>

#include "runtime/guiding/brdf_caches.h"
#include "runtime/guiding/conversions.h"
#include "runtime/guiding/surface_distribution_impl.h"

namespace lobe {
namespace {

constexpr float kInvPi = std::numbers::inv_pi_v<float>;

// Records that have seen less than five particles for each of eight components know little, and illumination of which
// less than this fraction has a shape is sampled by the BSDF as well as by a product.
constexpr float kUndersampled = 40;
constexpr float kUniformBackground = 0.98f;

/// The frame in which both factors of the product are given, as seen from the shading frame: z is the shading normal on
/// the side of wo, x the record's tangent made orthogonal to it. So records need no turning on flat surfaces.
Eigen::Matrix3f guidingAxes(const ShadingPoint& point, const PackedRecord& record, float side) {
  const Vec3& world = record.tangent;
  const Vec3 tangent(world.dot(toEigen(point.s)), world.dot(toEigen(point.t)), world.dot(toEigen(point.n)));
  const float length = tangent.head<2>().norm();
  const Vec2 x = length > 1e-4f ? Vec2(tangent.head<2>() / length) : Vec2(Vec2::UnitX());
  Eigen::Matrix3f axes;
  axes << x.x(), x.y(), 0, -side * x.y(), side * x.x(), 0, 0, 0, side;
  return axes;
}

/// Samples for what the mixtures do not know are the BSDF's: light that goes through the surface, lobes too narrow.
StrategyProbabilities onRepresentable(const StrategyProbabilities& probabilities, float representable) {
  return {representable * probabilities.product,
          1 - representable * (probabilities.product + probabilities.illumination),
          representable * probabilities.illumination};
}

/// The fraction of reflection that the mixtures describe.
float representableFraction(const Reflectance& reflectance) {
  const float all = reflectance.albedo + reflectance.unrepresentableAlbedo;
  return all > 0 ? reflectance.albedo / all : 1.0f;
}

}  // namespace

GuidingDecision SurfaceDistribution::Impl::decide() const {
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
  // On the back, lobes see the frame (s, −t, −n). The lobes we have are symmetric in t, so that this is theirs as well
  // as the mirrored (s, t, −n) of two-sided materials; for another lobe the density would be worse, not wrong.
  const Vec3 above(wo.x(), side * wo.y(), side * wo.z());
  const Vec2 turn(axes(0, 0), axes(1, 0));
  for (const TintedLobe& lobe : given.lobes)
    if (lobe.tint > 0) caches.add(lobe.lobe, above, turn, lobe.tint, reflectance);
}

FractionSample SurfaceDistribution::Impl::fractionSample(const Vec3& wi, float bsdfPdf) const {
  const float divided =
      representable * (1 - record->bsdfFraction);  // the mixtures' with the background that is the BSDF's
  const float background = density->bsdfFraction() - (1 - divided);
  const float mixtures = (std::max(0.0f, background) * bsdfPdf + density->guidedPdf(axes * wi)) / divided;
  return {record->index, bsdfPdf, mixtures, representable};
}

SurfaceDistribution::SurfaceDistribution(const Field& field, const ShadingPoint& point) {
  static_assert(kProductProbabilities.bsdf == kInitialBsdfFraction);
  static_assert(sizeof(Impl) <= kBytes && alignof(Impl) <= kAlignment && std::is_trivially_destructible_v<Impl>);
  const float side = point.wo.z >= 0 ? 1.0f : -1.0f;
  const PackedRecord* record = field.cache().find(toEigen(point.position), side * toEigen(point.normal));
  if (!record) return;
  hasRecord_ = true;
  // Default-initialised: the Gaussians of the reflectance and of the record are left as they are until they are set.
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

void SurfaceDistribution::describe(const SurfaceReflectance& reflectance, const LobeCacheSet* caches) {
  Impl& self = impl();
  self.product = caches != nullptr;
  self.described = reflectance.undescribedFraction <= 0;
  if (self.product) self.collectReflectance(reflectance, *caches->caches_);
  self.representable = (1 - reflectance.undescribedFraction) * representableFraction(self.reflectance);
  decision_ = self.decide();
  if (decision_ == GuidingDecision::tooNarrow || decision_ == GuidingDecision::uniform) return;
  const bool halves = !self.product || decision_ == GuidingDecision::undersampled;
  const StrategyProbabilities probabilities =
      halves ? kGuidedProbabilities : productProbabilities(self.record->bsdfFraction);
  self.density.emplace(self.reflectance, *self.record, onRepresentable(probabilities, self.representable));
  bsdfProbability_ = self.density->bsdfFraction();
  productOfGuided_ = self.density->productOfGuided();
}

std::optional<GuidedSample> SurfaceDistribution::sample(Strategy strategy, float choice, const Float2& u) const {
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
  // Nothing is known of what lobes without a fit reflect.
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
