#include "runtime/render/training/particle_state.h"

namespace lobe {
namespace {

std::optional<Scattered> scatterDelta(const SurfaceHit& hit, float fraction, float fluxScale(float), Sampler& rng) {
  const std::optional<DeltaSample> sample = sampleDelta(hit, rng.uniform());
  if (!sample) return std::nullopt;
  return Scattered{sample->wi, {}, sample->weight * (fluxScale(sample->eta) / fraction), 0};
}

}  // namespace

std::optional<Scattered> scatter(const SurfaceHit& hit, const GuidedSampler::Vertex* vertex, Transport transport,
                                 Sampler& rng) {
  // Sample weights include the scaling of radiance by refraction, which does not apply to flux.
  float (*const fluxScale)(float) =
      transport == Transport::flux ? [](float eta) { return eta * eta; } : [](float) { return 1.0f; };
  const float delta = hit.bsdf->deltaProbability(hit.wo, hit.uv);
  std::optional<Scattered> scattered;
  if (delta > 0 && rng.uniform() < delta) {
    scattered = scatterDelta(hit, delta, fluxScale, rng);
  } else {
    PathStatistics ignored;
    const std::optional<BsdfSample> sample = vertex->sample(rng, ignored);
    if (!sample) return std::nullopt;
    const float pdf = (1 - delta) * sample->pdf;
    scattered = {sample->wi, {}, sample->f * (fluxScale(sample->eta) * std::abs(sample->wi.z()) / pdf), pdf};
  }
  if (!scattered) return std::nullopt;
  scattered->direction = hit.frame.toWorld(scattered->wi).normalized();
  if (!sidesAgree(hit, scattered->direction, scattered->wi) || !usable(luminance(scattered->weight)))
    return std::nullopt;
  return scattered;
}

bool survivesAlbedo(Rgb& weight, const SurfaceHit& hit, Sampler& rng) {
  const float survival = std::min(1.0f, luminance(hit.bsdf->albedo(hit.wo, hit.uv)));
  if (!(rng.uniform() < survival)) return false;
  weight /= survival;
  return true;
}

}  // namespace lobe
