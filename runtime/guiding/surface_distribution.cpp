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
constexpr float kEvenBackground = 0.98f;

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
StrategyShares onCovered(const StrategyShares& shares, float covered) {
  return {covered * shares.product, 1 - covered * (shares.product + shares.illumination),
          covered * shares.illumination};
}

/// The fraction of reflection that the mixtures describe.
float coveredShare(const Reflectance& reflectance) {
  const float all = reflectance.albedo + reflectance.uncoveredAlbedo;
  return all > 0 ? reflectance.albedo / all : 1.0f;
}

}  // namespace

GuidingDecision SurfaceDistribution::Impl::decide() const {
  if (covered <= 0) return GuidingDecision::narrow;
  if (!product) return GuidingDecision::illumination;
  if (record->samples < kUndersampled) return GuidingDecision::undersampled;
  if (record->background > kEvenBackground) return GuidingDecision::even;
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

ShareSample SurfaceDistribution::Impl::shareSample(const Vec3& wi, float bsdfPdf) const {
  const float divided = covered * (1 - record->bsdfShare);  // the mixtures' with the background that is the BSDF's
  const float background = density->bsdfShare() - (1 - divided);
  const float mixtures = (std::max(0.0f, background) * bsdfPdf + density->guidedPdf(axes * wi)) / divided;
  return {cache->indexOf(*record), bsdfPdf, mixtures, covered};
}

SurfaceDistribution::SurfaceDistribution(const Field& field, const ShadingPoint& point) {
  static_assert(kProductShares.bsdf == kInitialBsdfFraction);
  static_assert(sizeof(Impl) <= kBytes && alignof(Impl) <= kAlignment && std::is_trivially_destructible_v<Impl>);
  // Default-initialised: the lanes of the reflectance stay as they are until they are filled.
  Impl& self = *new (storage_) Impl;
  self.cache = &field.cache();
  self.wo = toEigen(point.wo);
  self.side = point.wo.z >= 0 ? 1.0f : -1.0f;
  self.record = self.cache->find(toEigen(point.position), self.side * toEigen(point.normal));
  if (self.record) self.axes = guidingAxes(point, *self.record, self.side);
}

SurfaceDistribution::Impl& SurfaceDistribution::impl() {
  return *std::launder(reinterpret_cast<Impl*>(storage_));
}

const SurfaceDistribution::Impl& SurfaceDistribution::impl() const {
  return *std::launder(reinterpret_cast<const Impl*>(storage_));
}

bool SurfaceDistribution::hasRecord() const {
  return impl().record != nullptr;
}

void SurfaceDistribution::describe(const SurfaceReflectance& reflectance, const LobeCacheSet* caches) {
  Impl& self = impl();
  self.product = caches != nullptr;
  self.described = reflectance.undescribedShare <= 0;
  if (self.product) self.collectReflectance(reflectance, *caches->caches_);
  self.covered = (1 - reflectance.undescribedShare) * coveredShare(self.reflectance);
  self.decision = self.decide();
  const bool halves = !self.product || self.decision == GuidingDecision::undersampled;
  if (self.decision != GuidingDecision::narrow && self.decision != GuidingDecision::even)
    self.density.emplace(self.reflectance, *self.record,
                         onCovered(halves ? kGuidedShares : productShares(self.record->bsdfShare), self.covered));
}

GuidingDecision SurfaceDistribution::decision() const {
  return impl().decision;
}

float SurfaceDistribution::bsdfProbability() const {
  const Impl& self = impl();
  return self.density ? self.density->bsdfShare() : 1.0f;
}

Strategy SurfaceDistribution::choose(float& choice) const {
  const Impl& self = impl();
  return self.density ? self.density->choose(choice) : Strategy::bsdf;
}

std::optional<GuidedSample> SurfaceDistribution::sample(Strategy strategy, float choice, const Float2& u) const {
  const Impl& self = impl();
  const std::optional<Vec3> guided = self.density->sample(strategy, choice, toEigen(u));
  if (!guided) return std::nullopt;
  return GuidedSample{toFloats(Vec3(self.axes.transpose() * *guided)), self.density->guidedPdf(*guided)};
}

float SurfaceDistribution::guidedPdf(const Float3& wi) const {
  const Impl& self = impl();
  return self.density ? self.density->guidedPdf(self.axes * toEigen(wi)) : 0.0f;
}

std::optional<float> SurfaceDistribution::reflectedRadiance(float albedo) const {
  const Impl& self = impl();
  // Nothing is known of what lobes without a fit reflect.
  if (!self.record || !(self.record->irradiance > 0) || !self.described) return std::nullopt;
  if (!self.product) return self.record->irradiance * albedo * kInvPi;
  const bool shaped = self.decision == GuidingDecision::product || self.decision == GuidingDecision::illumination;
  return self.record->irradiance * (self.reflectance.uncoveredAlbedo * kInvPi +
                                    (shaped ? self.density->reflected() : self.reflectance.backgroundMass));
}

bool SurfaceDistribution::learnsFraction() const {
  return impl().learnsFraction();
}

}  // namespace lobe
