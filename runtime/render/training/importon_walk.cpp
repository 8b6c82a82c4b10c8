#include "runtime/render/training/importon_walk.h"

#include <algorithm>

namespace lobe {
void ImportonWalk::run(const Ray& cameraRay, std::uint64_t index) {
  recorder_.begin(index);
  result_.importance.beginPath(index);
  state_ = {cameraRay, Rgb::Ones()};
  for (depth_ = 1; depth_ <= std::min(kMaxTrainingDepth, maxDepth_); ++depth_)
    if (!advance()) break;
  recorder_.end();
}

// Traces one segment and processes its end point; returns false when the path ends.
bool ImportonWalk::advance() {
  const std::optional<SurfaceHit> hit = depth_ == 1 ? scene_.firstVisible(state_.ray) : scene_.tracer.trace(state_.ray);
  recorder_.setDistance(hit ? hit->distance : kInfinity);
  if (!hit) {
    escape();
    return false;
  }
  if (hit->emitter) collect(state_.weight * emittedRadiance(*hit) * emissionWeight_.ofSurface(*hit));
  if (!hit->bsdf || depth_ >= maxDepth_ || !sidesAgree(*hit, hit->woWorld, hit->wo)) return false;

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
  if (vertex && scattered->pdf > 0) {
    emissionWeight_.scattered(scene_.lights.at(hit), scattered->direction, scattered->pdf);
    remember(hit, *vertex, *scattered);
  } else {
    emissionWeight_.passed(hit, scattered->wi, scene_.shadowSurfaces);
  }
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
  const Rgb light = state_.weight * scene_.lights.environmentRadiance(wi) * emissionWeight_.ofEnvironment();
  collect(light);
  const float weight = luminance(light);
  if (wishes_.uses && depth_ > 1 && usable(weight)) result_.uses.push_back({state_.ray.origin, wi, weight});
}

void ImportonWalk::addDirectLight(const SurfaceHit& hit, const GuidedSampler::Vertex& vertex, float smoothFraction) {
  if (!wishes_.uses && !wishes_.samples && !wishes_.fractions) return;
  const double choice = rng_.uniformDouble();
  const std::optional<LightSample> light = scene_.lights.at(hit).sample(choice, rng_.uniform2());
  if (!light) return;
  const Vec3 wi = hit.frame.toLocal(light->wi);
  if (!sidesAgree(hit, light->wi, wi)) return;
  const Rgb value = state_.weight * evalBsdf(hit, wi) * (std::abs(wi.z()) / light->pdf);
  if (!usable(luminance(value))) return;
  const float weight = light->delta ? 1.0f : misWeight(light->pdf, smoothFraction * vertex.pdf(wi));
  const ArrivingLight arriving = scene_.arriving(hit, *light, std::min(kMaxTrainingDepth, maxDepth_ - depth_ - 1));
  const Rgb found = value * weight * arriving.radiance;
  collect(found);
  // Where photons of this light enter the scene. Light at the first surface is left to the renderer's next-event
  // estimation.
  const bool fromEnvironment = !light->source && !light->delta;
  if (wishes_.uses && fromEnvironment && depth_ > 1 && usable(luminance(found)))
    result_.uses.push_back({arriving.last.origin, arriving.last.direction, luminance(found)});
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
}

}  // namespace lobe
