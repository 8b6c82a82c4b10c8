// A path tracer on spheres that samples directions by what a lobe::Field has learnt, compared with BSDF sampling at the
// same number of samples. It has no next-event estimation, so that all light has to be found by chance or by guiding: a
// lamp in a niche lights a room of diffuse spheres indirectly.

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <numbers>
#include <optional>
#include <random>
#include <vector>

#include <lobe/field.h>
#include <lobe/path_recorder.h>
#include <lobe/surface_distribution.h>

namespace {

using lobe::Float2;
using lobe::Float3;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kPi = std::numbers::pi_v<float>;

Float3 operator+(Float3 a, Float3 b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
Float3 operator-(Float3 a, Float3 b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
Float3 operator*(float k, Float3 a) {
  return {k * a.x, k * a.y, k * a.z};
}
float dot(Float3 a, Float3 b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
Float3 cross(Float3 a, Float3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
Float3 normalized(Float3 a) {
  return (1 / std::sqrt(dot(a, a))) * a;
}
Float3 grey(float value) {
  return {value, value, value};
}

struct Sphere {
  Float3 centre;
  float radius, albedo, emission;
};

// The room is the inside of the first sphere. The last hides the lamp from the camera and from most of the room.
const std::vector<Sphere> kSpheres = {{{0, 0, 0}, 4, 0.7f, 0},
                                      {{-1.2f, -1, 0.5f}, 0.9f, 0.6f, 0},
                                      {{0, 3.3f, 0}, 0.25f, 0, 60},
                                      {{0, 2.2f, 0}, 0.8f, 0.7f, 0}};

struct Hit {
  float distance;
  Float3 position, normal;  // on the side of the ray
  const Sphere* sphere;
};

std::optional<Hit> trace(Float3 origin, Float3 direction) {
  std::optional<Hit> nearest;
  for (const Sphere& sphere : kSpheres) {
    const Float3 to = sphere.centre - origin;
    const float along = dot(to, direction), discriminant = along * along - dot(to, to) + sphere.radius * sphere.radius;
    if (discriminant < 0) continue;
    for (const float t : {along - std::sqrt(discriminant), along + std::sqrt(discriminant)}) {
      if (t < 1e-3f || (nearest && t >= nearest->distance)) continue;
      const Float3 position = origin + t * direction;
      const Float3 outside = normalized(position - sphere.centre);
      nearest = Hit{t, position, dot(outside, direction) < 0 ? outside : -1 * outside, &sphere};
    }
  }
  return nearest;
}

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  float operator()() { return static_cast<float>(engine_() >> 40) * 0x1p-24f; }

 private:
  std::mt19937_64 engine_;
};

struct Frame {
  Float3 s, t, n;
  explicit Frame(Float3 normal) : n(normal) {
    s = normalized(std::abs(n.x) > 0.5f ? cross(n, {0, 1, 0}) : cross(n, {1, 0, 0}));
    t = cross(n, s);
  }
  Float3 toWorld(Float3 v) const { return v.x * s + v.y * t + v.z * n; }
  Float3 toLocal(Float3 v) const { return {dot(v, s), dot(v, t), dot(v, n)}; }
};

struct Direction {
  Float3 wi;
  float pdf;
};

/// Chooses between the diffuse BSDF's sampler and the field's mixtures; the density is that of both together.
std::optional<Direction> sampleDirection(const lobe::SurfaceDistribution* guide, Random& random) {
  float choice = random();
  const Float2 u{random(), random()};
  const lobe::Strategy strategy = guide ? guide->choose(choice) : lobe::Strategy::bsdf;
  Float3 wi;
  if (strategy == lobe::Strategy::bsdf) {
    const float r = std::sqrt(u.x), phi = 2 * kPi * u.y;
    wi = {r * std::cos(phi), r * std::sin(phi), std::sqrt(1 - u.x)};
  } else {
    const std::optional<lobe::GuidedSample> sample = guide->sample(strategy, choice, u);
    if (!sample) return std::nullopt;
    wi = sample->wi;
  }
  if (wi.z <= 0) return std::nullopt;
  const float bsdfPdf = wi.z / kPi;
  return Direction{wi, guide ? guide->bsdfProbability() * bsdfPdf + guide->guidedPdf(wi) : bsdfPdf};
}

/// The radiance along a ray. field: nullptr for plain path tracing; recorder: told of the path where training wants it.
float radiance(Float3 origin, Float3 direction, const lobe::Field* field, lobe::SampleStorage* storage,
               lobe::PathRecorder* recorder, Random& random) {
  float result = 0, throughput = 1;
  for (int depth = 0; depth < 12; ++depth) {
    const std::optional<Hit> hit = trace(origin, direction);
    if (recorder && depth > 0) recorder->setDistance(hit ? hit->distance : kInfinity);
    if (!hit) break;
    result += throughput * hit->sphere->emission;
    if (recorder) recorder->addLight(grey(throughput * hit->sphere->emission));
    if (hit->sphere->albedo <= 0) break;

    const Frame frame(hit->normal);
    std::optional<lobe::SurfaceDistribution> guide;
    if (field) {
      guide.emplace(*field, lobe::ShadingPoint{hit->position, hit->normal, frame.s, frame.t, frame.n,
                                               frame.toLocal(-1 * direction)});
      if (guide->hasRecord())
        guide->describe({.lobes = {}, .diffuseAlbedo = hit->sphere->albedo}, nullptr);
      else if (storage)
        storage->requestRecord(hit->position, hit->normal);
    }
    const std::optional<Direction> next = sampleDirection(guide ? &*guide : nullptr, random);
    if (!next) break;
    const float weight = hit->sphere->albedo / kPi * next->wi.z / next->pdf;
    throughput *= weight;
    origin = hit->position;
    direction = normalized(frame.toWorld(next->wi));
    if (recorder)
      recorder->addVertex({.position = hit->position,
                           .normal = hit->normal,
                           .direction = direction,
                           .wi = next->wi,
                           .pdf = next->pdf,
                           .weight = grey(weight),
                           .throughput = grey(throughput)},
                          guide ? &*guide : nullptr);
  }
  return result;
}

struct Estimate {
  double mean, variance;  // of one sample
};

constexpr Float3 kCamera{0, -0.5f, 3.5f};

Float3 cameraDirection(Random& random) {
  return normalized({0.8f * (random() - 0.5f), 0.8f * (random() - 0.5f), -1});
}

Estimate render(const lobe::Field* field, int samples) {
  Random random(7);
  double sum = 0, squares = 0;
  for (int i = 0; i < samples; ++i) {
    const double value = radiance(kCamera, cameraDirection(random), field, nullptr, nullptr, random);
    sum += value;
    squares += value * value;
  }
  const double mean = sum / samples;
  return {mean, squares / samples - mean * mean};
}

}  // namespace

int main() {
  lobe::FieldOptions options;
  options.sceneDiagonal = 8 * std::sqrt(3.0f);
  lobe::Field field(options);
  for (int pass = 0; pass < 8; ++pass) {
    lobe::SampleStorage storage;
    lobe::PathRecorder recorder(storage);
    Random random(100 + static_cast<std::uint64_t>(pass));
    for (std::uint64_t path = 0; path < 30000; ++path) {
      recorder.begin(path);
      radiance(kCamera, cameraDirection(random), &field, &storage, &recorder, random);
      recorder.end();
    }
    field.update(storage);
  }
  std::printf("%zu records\n", field.records());
  constexpr int kSamples = 200000;
  const Estimate plain = render(nullptr, kSamples), guided = render(&field, kSamples);
  std::printf("plain:  mean %.4f, variance %.3f\n", plain.mean, plain.variance);
  std::printf("guided: mean %.4f, variance %.3f (%.2f of plain)\n", guided.mean, guided.variance,
              guided.variance / plain.variance);
  // The means agree within their noise, and guiding pays.
  const double error = std::sqrt((plain.variance + guided.variance) / kSamples);
  return std::abs(plain.mean - guided.mean) < 4 * error && guided.variance < plain.variance ? 0 : 1;
}
