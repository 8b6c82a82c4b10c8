#include "runtime/render/guided_integrator.h"

namespace lobe {
namespace {

SamplingStrategy asCounted(Strategy strategy) {
  switch (strategy) {
    case Strategy::product:
      return SamplingStrategy::product;
    case Strategy::illumination:
      return SamplingStrategy::illumination;
    default:
      return SamplingStrategy::bsdf;
  }
}

float sideOf(const SurfaceHit& hit) {
  return hit.wo.z() >= 0 ? 1.0f : -1.0f;
}

/// The frame in which both factors of the product are given, as seen from the shading frame: z is the shading normal on
/// the side of wo, x the record's tangent made orthogonal to it. So records need no turning on flat surfaces.
Eigen::Matrix3f guideAxes(const SurfaceHit& hit, const PackedRecord& record, float side) {
  const Vec3 tangent = hit.frame.toLocal(record.tangent);
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

/// The share of reflection that the mixtures describe.
float coveredShare(const Reflectance& reflectance) {
  const float all = reflectance.albedo + reflectance.uncoveredAlbedo;
  return all > 0 ? reflectance.albedo / all : 1.0f;
}

// Records that have seen less than five particles for each of eight components know little, and light of which less
// than this share has a shape is sampled by the BSDF as well as by a product.
constexpr float kUndersampled = 40;
constexpr float kEvenBackground = 0.98f;

}  // namespace

std::vector<LobeRequest> lobeRequests(const Scene& scene) {
  std::vector<LobeRequest> requests;
  for (const Material& material : scene.materials)
    for (const LobePtr& lobe : material.bsdf->lobes())
      requests.push_back({lobe->model(), lobe->key(), lobe->revision(), material.name});
  return requests;
}

GuidedSampler::GuidedSampler(const Scene& scene, const IlluminationCache& illumination, const BrdfCaches* caches)
    : illumination_(illumination), caches_(caches) {
  int next = 0;
  for (const Material& material : scene.materials) {
    firstRequest_.push_back(next);
    next += static_cast<int>(material.bsdf->lobes().size());
  }
}

GuidedSampler::Vertex::Vertex(const GuidedSampler& sampler, const SurfaceHit& hit)
    : hit_(hit), record_(sampler.illumination_.find(hit.position, sideOf(hit) * hit.normal)) {
  if (!record_) return;
  const float side = sideOf(hit);
  axes_ = guideAxes(hit, *record_, side);
  const LobeMixture mixture = hit.bsdf->mixture(hit.wo, hit.uv);
  described_ = mixture.undescribedShare <= 0;
  product_ = sampler.caches_ != nullptr;
  if (product_) collectReflectance(sampler, hit, mixture, side);
  covered_ = (1 - mixture.undescribedShare) * coveredShare(reflectance_);
  decision_ = decide();
  const bool halves = !product_ || decision_ == GuidingDecision::undersampled;
  if (decision_ != GuidingDecision::narrow && decision_ != GuidingDecision::even)
    density_.emplace(reflectance_, *record_,
                     onCovered(halves ? kGuidedShares : productShares(record_->bsdfShare), covered_));
}

GuidingDecision GuidedSampler::Vertex::decide() const {
  if (covered_ <= 0) return GuidingDecision::narrow;
  if (!product_) return GuidingDecision::illumination;
  if (record_->samples < kUndersampled) return GuidingDecision::undersampled;
  if (record_->background > kEvenBackground) return GuidingDecision::even;
  return reflectance_.gaussians.count() > 0 ? GuidingDecision::product : GuidingDecision::illumination;
}

void GuidedSampler::Vertex::collectReflectance(const GuidedSampler& sampler, const SurfaceHit& hit,
                                               const LobeMixture& mixture, float side) {
  reflectance_.constant = mixture.constant * kInvPi;
  reflectance_.backgroundMass = reflectance_.constant;
  reflectance_.albedo = mixture.constant;
  // On the back, lobes see the frame (s, −t, −n). The lobes we have are symmetric in t, so that this is theirs as well
  // as the mirrored (s, t, −n) of two-sided materials; for another lobe the density would be worse, not wrong.
  const Vec3 wo(hit.wo.x(), side * hit.wo.y(), side * hit.wo.z());
  const Vec2 turn(axes_(0, 0), axes_(1, 0));
  const int first = sampler.firstRequest_[hit.material];
  for (int i = 0; i < mixture.glossyCount; ++i)
    if (mixture.glossy[i].tint > 0)
      sampler.caches_->add(first + mixture.glossy[i].lobe, wo, turn, mixture.glossy[i].tint, reflectance_);
}

std::optional<BsdfSample> GuidedSampler::Vertex::sample(Rng& rng, PathStatistics& statistics) const {
  float choice = rng.uniform();
  const Vec2 u = rng.uniform2();
  const Strategy strategy = density_ ? density_->choose(choice) : Strategy::bsdf;
  statistics.count(asCounted(strategy));
  statistics.count(decision_);
  if (strategy == Strategy::bsdf) {
    std::optional<BsdfSample> sample = sampleBsdf(hit_, choice, u);
    if (sample && density_)
      sample->pdf = density_->bsdfShare() * sample->pdf + density_->guidedPdf(toGuide(sample->wi));
    return sample;
  }
  const std::optional<Vec3> guide = density_->sample(strategy, choice, u);
  if (!guide) return std::nullopt;
  const Vec3 wi = axes_.transpose() * *guide;
  const Rgb f = evalBsdf(hit_, wi);
  if (!(f.maxCoeff() > 0)) return std::nullopt;
  return BsdfSample{wi, f, density_->bsdfShare() * hit_.bsdf->pdf(hit_.wo, wi, hit_.uv) + density_->guidedPdf(*guide)};
}

float GuidedSampler::Vertex::pdf(const Vec3& wi) const {
  const float bsdf = hit_.bsdf->pdf(hit_.wo, wi, hit_.uv);
  return density_ ? density_->bsdfShare() * bsdf + density_->guidedPdf(toGuide(wi)) : bsdf;
}

std::optional<ShareSample> GuidedSampler::Vertex::shareSample(const Vec3& wi) const {
  if (decision_ != GuidingDecision::product && !(product_ && decision_ == GuidingDecision::illumination))
    return std::nullopt;
  const float bsdf = hit_.bsdf->pdf(hit_.wo, wi, hit_.uv);
  const float divided = covered_ * (1 - record_->bsdfShare);  // the mixtures' with the background that is the BSDF's
  const float background = density_->bsdfShare() - (1 - divided);
  const float mixtures = (std::max(0.0f, background) * bsdf + density_->guidedPdf(toGuide(wi))) / divided;
  return ShareSample{record_, bsdf, mixtures, covered_};
}

std::optional<float> GuidedSampler::Vertex::reflectedRadiance() const {
  // Nothing is known of light that comes through the surface, nor of what lobes without a fit reflect.
  if (!record_ || !(record_->irradiance > 0) || hit_.bsdf->transmits() || !described_) return std::nullopt;
  const float diffuse = product_ ? reflectance_.uncoveredAlbedo : luminance(hit_.bsdf->albedo(hit_.wo, hit_.uv));
  if (!product_) return record_->irradiance * diffuse * kInvPi;
  const bool shaped = decision_ == GuidingDecision::product || decision_ == GuidingDecision::illumination;
  return record_->irradiance * (diffuse * kInvPi + (shaped ? density_->reflected() : reflectance_.backgroundMass));
}

Rgb GuidedIntegrator::radiance(const Ray& ray, Rng& rng, PathStatistics& statistics) const {
  return PathLoop(scene_, options_, sampler_).radiance(ray, rng, statistics);
}

}  // namespace lobe
