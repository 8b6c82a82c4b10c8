#include "runtime/render/training/importon_walk.h"

namespace lobe {
namespace {

/// How light from the environment reaches a point.
enum class Passage { blocked, free, refracted };

/// Follows the direction through surfaces that refract, ignoring the change of direction: exact for window panes, and
/// accurate enough to learn where photons should start.
Passage passageToEnvironment(const RayTracer& tracer, const SurfacePoint& from, const Vec3& direction) {
  constexpr int maxSurfaces = 16;
  Passage passage = Passage::free;
  Ray ray = spawnRay(from, direction);
  for (int i = 0; i < maxSurfaces; ++i) {
    const std::optional<SurfaceHit> hit = tracer.trace(ray);
    if (!hit) return passage;
    if (!hit->bsdf || !hit->bsdf->transmits() || hit->bsdf->deltaProbability(hit->wo, hit->uv) <= 0)
      return Passage::blocked;
    passage = Passage::refracted;
    ray = spawnRay(*hit, direction);
  }
  return Passage::blocked;
}

}  // namespace

void ImportonWalk::run(const Ray& cameraRay, std::uint64_t index) {
  recorder_.begin(index);
  result_.importance.beginPath(index);
  state_ = {cameraRay, Rgb::Ones()};
  for (depth_ = 1; depth_ <= kMaxTrainingDepth; ++depth_)
    if (!advance()) break;
  recorder_.end();
}

// Traces one segment and processes its end point; returns false when the path ends.
bool ImportonWalk::advance() {
  const std::optional<SurfaceHit> hit = scene_.tracer.trace(state_.ray);
  if (awaitsDistance_) recorder_.setDistance(hit ? hit->distance : kInfinity);
  awaitsDistance_ = false;
  if (!hit) {
    escape();
    return false;
  }
  if (hit->emitter && pdf_ > 0) {
    const float weight = misWeight(pdf_, scene_.lights.pdf(previous_, *hit));
    collect(state_.weight * emittedRadiance(*hit) * weight);
  } else if (hit->emitter) {
    collect(state_.weight * emittedRadiance(*hit));
  }
  if (!hit->bsdf || !sidesAgree(*hit, hit->woWorld, hit->wo)) return false;

  const float delta = hit->bsdf->deltaProbability(hit->wo, hit->uv);
  if (delta >= 1) return goOn(*hit, nullptr);
  const GuidedSampler::Vertex vertex(sampler_, *hit);
  if (!vertex.distribution().hasRecord())
    result_.radiance.requestRecord(asFloats(hit->position), asFloats(normalTowards(*hit)));
  arrive(*hit);
  addDirectLight(*hit, vertex, 1 - delta);
  return goOn(*hit, &vertex);
}

bool ImportonWalk::goOn(const SurfaceHit& hit, const GuidedSampler::Vertex* vertex) {
  const std::optional<Scattered> scattered = scatter(hit, vertex, Transport::radiance, rng_);
  if (!scattered) return false;
  state_.weight *= scattered->weight;
  state_.ray = spawnRay(hit, scattered->direction);
  pdf_ = scattered->pdf;
  previous_ = hit.position;
  if (scattered->pdf > 0) remember(hit, *vertex, *scattered);
  return survivesAlbedo(state_.weight, hit, rng_) && usable(luminance(state_.weight));
}

// Importance that arrives from the camera directly or only by specular reflection is not stored: photons guided by it
// would travel into the lens.
void ImportonWalk::arrive(const SurfaceHit& hit) {
  if (wishes_.importance && scattered_)
    result_.importance.addPhoton(asFloats(hit.position), asFloats(normalTowards(hit)), asFloats(hit.woWorld),
                                 luminance(state_.weight), hit.distance, 0);
}

// Environment light that the camera sees directly needs no photons; elsewhere it is weighted against next-event
// estimation.
void ImportonWalk::escape() {
  const Vec3& wi = state_.ray.direction;
  const float fraction = pdf_ > 0 ? misWeight(pdf_, scene_.lights.environmentPdf(wi)) : 1.0f;
  const Rgb light = state_.weight * scene_.lights.environmentRadiance(wi) * fraction;
  collect(light);
  const float weight = luminance(light);
  if (wishes_.uses && depth_ > 1 && usable(weight)) result_.uses.push_back({state_.ray.origin, wi, weight});
}

void ImportonWalk::addDirectLight(const SurfaceHit& hit, const GuidedSampler::Vertex& vertex, float smoothFraction) {
  if (!wishes_.uses && !wishes_.samples && !wishes_.fractions) return;
  const float choice = rng_.uniform();
  const std::optional<LightSample> light = scene_.lights.sample(hit.position, choice, rng_.uniform2());
  if (!light) return;
  const Vec3 wi = hit.frame.toLocal(light->wi);
  if (!sidesAgree(hit, light->wi, wi)) return;
  const Rgb value = state_.weight * evalBsdf(hit, wi) * light->radiance * (std::abs(wi.z()) / light->pdf);
  if (!usable(luminance(value))) return;
  const float weight = light->delta ? 1.0f : misWeight(light->pdf, smoothFraction * vertex.pdf(wi));
  if (!light->source && !light->delta)
    addEnvironmentLight(hit, light->wi, value, weight);
  else if ((wishes_.samples || wishes_.fractions) && scene_.visible(hit, *light))
    collect(value * weight);
}

void ImportonWalk::addEnvironmentLight(const SurfaceHit& hit, const Vec3& wi, const Rgb& light, float weight) {
  const Passage passage = passageToEnvironment(scene_.tracer, hit, wi);
  if (passage == Passage::free) collect(light * weight);
  // Unoccluded light at the first surface is left to the renderer's next-event estimation, which does not find light
  // through panes.
  if (!wishes_.uses || passage == Passage::blocked || (passage == Passage::free && depth_ == 1)) return;
  result_.uses.push_back({hit.position, wi, luminance(light) * (passage == Passage::free ? weight : 1.0f)});
}

void ImportonWalk::remember(const SurfaceHit& hit, const GuidedSampler::Vertex& vertex, const Scattered& scattered) {
  scattered_ = true;
  if (!wishes_.samples && !wishes_.fractions) return;
  const bool learnsFraction = wishes_.fractions && vertex.distribution().learnsFraction();
  recorder_.addVertex({.position = asFloats(hit.position),
                       .normal = asFloats(hit.normal),
                       .direction = asFloats(scattered.direction),
                       .wi = asFloats(scattered.wi),
                       .pdf = scattered.pdf,
                       .bsdfPdf = learnsFraction ? hit.bsdf->pdf(hit.wo, scattered.wi, hit.uv) : 0,
                       .weight = asFloats(scattered.weight),
                       .throughput = asFloats(state_.weight)},
                      &vertex.distribution());
  awaitsDistance_ = true;
}

}  // namespace lobe
