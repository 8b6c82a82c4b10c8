#include "runtime/render/integrators/guided_integrator.h"

#include <array>
#include <span>

#include "runtime/render/integrators/public_types.h"

namespace lobe {
namespace {

ShadingPoint pointOf(const SurfaceHit& hit) {
  const Frame& frame = hit.frame;
  return {asFloats(hit.position), asFloats(hit.normal), asFloats(frame.s),
          asFloats(frame.t),      asFloats(frame.n),    asFloats(hit.wo)};
}

}  // namespace

std::vector<LobeRequest> lobeRequests(const Scene& scene) {
  std::vector<LobeRequest> requests;
  for (const Material& material : scene.materials)
    for (const LobePtr& lobe : material.bsdf->lobes())
      requests.push_back({lobe->model(), lobe->key(), lobe->revision(), material.name});
  return requests;
}

GuidedSampler::GuidedSampler(const Scene& scene, const Field& field, const LobeCacheSet* caches)
    : field_(field), caches_(caches) {
  int next = 0;
  for (const Material& material : scene.materials) {
    firstRequest_.push_back(next);
    next += static_cast<int>(material.bsdf->lobes().size());
  }
}

GuidedSampler::Vertex::Vertex(const GuidedSampler& sampler, const SurfaceHit& hit)
    : sampler_(sampler), hit_(hit), distribution_(sampler.field_, pointOf(hit)) {
  if (!distribution_.hasRecord()) return;
  const LobeMixture mixture = hit.bsdf->mixture(hit.wo, hit.uv);
  const int first = sampler.firstRequest_[hit.material];
  std::array<TintedLobe, kMaxLobes> lobes;
  for (int i = 0; i < mixture.glossyCount; ++i) lobes[i] = {first + mixture.glossy[i].lobe, mixture.glossy[i].tint};
  distribution_.describe({std::span<const TintedLobe>(lobes.data(), static_cast<std::size_t>(mixture.glossyCount)),
                          mixture.constant, mixture.undescribedFraction},
                         sampler.caches_);
}

std::optional<BsdfSample> GuidedSampler::Vertex::sample(Sampler& rng, PathStatistics& statistics) const {
  float choice = rng.stratified();
  const Vec2 u = rng.stratified2();
  const Strategy strategy = distribution_.choose(choice);
  statistics.count(strategy);
  statistics.count(distribution_.decision());
  const float bsdfProbability = distribution_.bsdfProbability();
  if (strategy == Strategy::bsdf) {
    std::optional<BsdfSample> sample = sampleBsdf(hit_, choice, u);
    if (sample && bsdfProbability < 1)
      sample->pdf = bsdfProbability * sample->pdf + distribution_.guidedPdf(asFloats(sample->wi));
    return sample;
  }
  const std::optional<GuidedSample> guided = distribution_.sample(strategy, choice, {u.x(), u.y()});
  if (!guided) return std::nullopt;
  const Vec3 wi(guided->wi.x, guided->wi.y, guided->wi.z);
  const Rgb f = evalBsdf(hit_, wi);
  if (!(f.maxCoeff() > 0)) return std::nullopt;
  return BsdfSample{wi, f, bsdfProbability * hit_.bsdf->pdf(hit_.wo, wi, hit_.uv) + guided->guidedPdf};
}

float GuidedSampler::Vertex::pdf(const Vec3& wi) const {
  const float bsdf = hit_.bsdf->pdf(hit_.wo, wi, hit_.uv);
  const float probability = distribution_.bsdfProbability();
  return probability < 1 ? probability * bsdf + distribution_.guidedPdf(asFloats(wi)) : bsdf;
}

std::optional<VertexEstimate> GuidedSampler::Vertex::estimate() const {
  // Transmitted light is not estimated.
  if (!distribution_.hasRecord() || hit_.bsdf->transmits()) return std::nullopt;
  const float albedo = sampler_.caches_ ? 0.0f : luminance(hit_.bsdf->albedo(hit_.wo, hit_.uv));
  const std::optional<float> radiance = distribution_.reflectedRadiance(albedo);
  if (!radiance) return std::nullopt;
  return VertexEstimate{*radiance, distribution_.recordIndex()};
}

Rgb GuidedIntegrator::radiance(const Ray& ray, Sampler& rng, PathStatistics& statistics) const {
  return PathLoop(scene_, options_, sampler_).radiance(ray, rng, statistics);
}

}  // namespace lobe
