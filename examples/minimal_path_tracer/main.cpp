// A path tracer for spheres that compares three ways of sampling directions at the same number of samples: BSDF
// sampling ("plain"), the illumination learnt by a lobe::Field ("guided"), and the product of that illumination with a
// glossy lobe ("product"). In the scene, an occluded lamp illuminates a room with diffuse and glossy spheres
// indirectly. There is no next-event estimation, so that directional sampling must find all light.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <lobe/cache_set.h>
#include <lobe/field.h>
#include <lobe/fitting.h>
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

/// A sphere with the BSDF diffuse / π + glossy · glossyLobe; emission is radiance.
struct Sphere {
  Float3 centre;
  float radius, diffuse, glossy, emission;
};

// The room is the inside of the first sphere. The last sphere occludes the lamp from the camera and most of the room.
const std::vector<Sphere> kSpheres = {{{0, 0, 0}, 4, 0.7f, 0, 0},
                                      {{-1.2f, -1, 0.5f}, 0.9f, 0.6f, 0, 0},
                                      {{1.1f, -1.2f, 0.4f}, 1.1f, 0.1f, 0.8f, 0},
                                      {{0, 3.3f, 0}, 0.25f, 0, 0, 60},
                                      {{0, 2.2f, 0}, 0.8f, 0.7f, 0, 0}};

struct Hit {
  float distance;
  Float3 position, normal;  // normal: unit, on the side of the ray
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

// The glossy lobe: the normalised Phong model, with an albedo below one (Lafortune and Willems 1994).
constexpr float kExponent = 60;

Float3 mirrored(Float3 wo) {
  return {-wo.x, -wo.y, wo.z};
}

float glossyLobe(Float3 wo, Float3 wi) {
  const float cosine = dot(mirrored(wo), wi);
  return wi.z > 0 && cosine > 0 ? (kExponent + 2) / (2 * kPi) * std::pow(cosine, kExponent) : 0;
}

float glossyPdf(Float3 wo, Float3 wi) {
  const float cosine = dot(mirrored(wo), wi);
  return cosine > 0 ? (kExponent + 1) / (2 * kPi) * std::pow(cosine, kExponent) : 0;
}

Float3 sampleGlossy(Float3 wo, Float2 u) {
  const float cosine = std::pow(1 - u.x, 1 / (kExponent + 1)), phi = 2 * kPi * u.y;
  const float sine = std::sqrt(std::max(0.0f, 1 - cosine * cosine));
  return Frame(mirrored(wo)).toWorld({sine * std::cos(phi), sine * std::sin(phi), cosine});
}

/// The lobe as input of lobe::compileLobe.
lobe::LobeFunctions lobeFunctions() {
  lobe::LobeFunctions functions;
  functions.model = "phong";
  functions.key = "phong exponent=" + std::to_string(kExponent);
  functions.evaluate = [](Float3 wo, Float3 wi) { return glossyLobe(wo, wi); };
  functions.sample = [](Float3 wo, Float2 u) -> std::optional<lobe::LobeDirection> {
    const Float3 wi = normalized(sampleGlossy(wo, u));
    if (wi.z <= 0) return std::nullopt;
    return lobe::LobeDirection{wi, glossyPdf(wo, wi)};
  };
  functions.pdf = [](Float3 wo, Float3 wi) { return glossyPdf(wo, wi); };
  return functions;
}

/// The BSDF of a sphere for a given wo, in the local frame.
struct Bsdf {
  float diffuse, glossy;
  Float3 wo;

  float glossyProbability() const { return glossy / (diffuse + glossy); }
  float evaluate(Float3 wi) const { return diffuse / kPi + glossy * glossyLobe(wo, wi); }
  float pdf(Float3 wi) const {
    return glossyProbability() * glossyPdf(wo, wi) + (1 - glossyProbability()) * wi.z / kPi;
  }
  Float3 sample(float choice, Float2 u) const {
    if (choice < glossyProbability()) return normalized(sampleGlossy(wo, u));
    const float r = std::sqrt(u.x), phi = 2 * kPi * u.y;
    return {r * std::cos(phi), r * std::sin(phi), std::sqrt(1 - u.x)};
  }
};

struct Direction {
  Float3 wi;
  float pdf, bsdfPdf;
};

/// Samples a direction with the BSDF's sampler or the guiding distribution; pdf is the density of their combination.
std::optional<Direction> sampleDirection(const Bsdf& bsdf, const lobe::SurfaceDistribution* guide, Random& random) {
  float choice = random();
  const Float2 u{random(), random()};
  const lobe::Strategy strategy = guide ? guide->choose(choice) : lobe::Strategy::bsdf;
  Float3 wi;
  if (strategy == lobe::Strategy::bsdf) {
    wi = bsdf.sample(choice, u);
  } else {
    const std::optional<lobe::GuidedSample> sample = guide->sample(strategy, choice, u);
    if (!sample) return std::nullopt;
    wi = sample->wi;
  }
  if (wi.z <= 0) return std::nullopt;
  const float bsdfPdf = bsdf.pdf(wi);
  return Direction{wi, guide ? guide->bsdfProbability() * bsdfPdf + guide->guidedPdf(wi) : bsdfPdf, bsdfPdf};
}

/// How paths are guided: not at all (no field), by illumination (no caches), or by the product.
struct Guide {
  const lobe::Field* field = nullptr;
  const lobe::LobeCacheSet* caches = nullptr;
};

/// Estimates the radiance along a ray with one path. storage and recorder are given in training only: requests for
/// records and the vertices of the path are added to them.
float radiance(Float3 origin, Float3 direction, const Guide& guide, lobe::SampleStorage* storage,
               lobe::PathRecorder* recorder, Random& random) {
  float result = 0, throughput = 1;
  for (int depth = 0; depth < 12; ++depth) {
    const std::optional<Hit> hit = trace(origin, direction);
    if (recorder) recorder->setDistance(hit ? hit->distance : kInfinity);
    if (!hit) break;
    result += throughput * hit->sphere->emission;
    if (recorder) recorder->addLight(grey(throughput * hit->sphere->emission));
    if (hit->sphere->emission > 0) break;

    const Frame frame(hit->normal);
    const Bsdf bsdf{hit->sphere->diffuse, hit->sphere->glossy, frame.toLocal(-1 * direction)};
    std::optional<lobe::SurfaceDistribution> distribution;
    if (guide.field) {
      const lobe::ShadingPoint point{hit->position, hit->normal, frame.s, frame.t, frame.n, bsdf.wo};
      distribution.emplace(*guide.field, point);
      const lobe::TintedLobe glossy{0, bsdf.glossy};
      if (distribution->hasRecord())
        distribution->describe({.lobes = {&glossy, bsdf.glossy > 0 ? 1u : 0u}, .diffuseAlbedo = bsdf.diffuse},
                               guide.caches);
      else if (storage)
        storage->requestRecord(point);
    }
    const std::optional<Direction> next = sampleDirection(bsdf, distribution ? &*distribution : nullptr, random);
    if (!next) break;
    const float weight = bsdf.evaluate(next->wi) * next->wi.z / next->pdf;
    throughput *= weight;
    origin = hit->position;
    direction = normalized(frame.toWorld(next->wi));
    if (recorder)
      recorder->addVertex({.position = hit->position,
                           .normal = hit->normal,
                           .direction = direction,
                           .wi = next->wi,
                           .pdf = next->pdf,
                           .bsdfPdf = next->bsdfPdf,
                           .weight = grey(weight),
                           .throughput = grey(throughput)},
                          distribution ? &*distribution : nullptr);
  }
  return result;
}

struct Estimate {
  double mean, variance;  // variance of one sample
};

constexpr Float3 kCamera{0, -0.5f, 3.5f};

Float3 cameraDirection(Random& random) {
  return normalized({0.8f * (random() - 0.5f), 0.8f * (random() - 0.5f), -1});
}

Estimate render(const Guide& guide, int samples) {
  Random random(7);
  double sum = 0, squares = 0;
  for (int i = 0; i < samples; ++i) {
    const double value = radiance(kCamera, cameraDirection(random), guide, nullptr, nullptr, random);
    sum += value;
    squares += value * value;
  }
  const double mean = sum / samples;
  return {mean, squares / samples - mean * mean};
}

lobe::Field train(const lobe::LobeCacheSet& caches) {
  lobe::FieldOptions options;
  options.sceneDiagonal = 8 * std::sqrt(3.0f);
  lobe::Field field(options);
  for (int pass = 0; pass < 8; ++pass) {
    lobe::SampleStorage storage;
    lobe::PathRecorder recorder(storage);
    Random random(100 + static_cast<std::uint64_t>(pass));
    for (std::uint64_t path = 0; path < 30000; ++path) {
      recorder.begin(path);
      radiance(kCamera, cameraDirection(random), {&field, &caches}, &storage, &recorder, random);
      recorder.end();
    }
    field.update(storage);
  }
  return field;
}

}  // namespace

int main() {
  const lobe::LobeFunctions glossy = lobeFunctions();
  lobe::FittingOptions fitting;
  fitting.folder = std::filesystem::temp_directory_path() / "minimal_path_tracer";
  const lobe::CompiledLobe compiled = lobe::compileLobe(glossy, fitting);
  std::printf("%s: %zu records, relative variance at most %.3f\n", compiled.file.filename().c_str(), compiled.records,
              compiled.worstRelativeVariance);
  const std::vector<lobe::LobeRequest> requests{{glossy.model, glossy.key, glossy.revision, "glossy sphere"}};
  const lobe::LobeCacheSet caches(fitting.folder, requests, "minimal_path_tracer");

  const lobe::Field field = train(caches);
  std::printf("%zu illumination records\n", field.records());

  constexpr int kSamples = 200000;
  const Estimate plain = render({}, kSamples), guided = render({&field}, kSamples),
                 product = render({&field, &caches}, kSamples);
  const auto print = [&](const char* name, const Estimate& e) {
    std::printf("%-8s mean %.4f, variance %.3f (%.2f of plain)\n", name, e.mean, e.variance,
                e.variance / plain.variance);
  };
  print("plain", plain);
  print("guided", guided);
  print("product", product);
  // The means must agree within their noise, and each method must have a lower variance than the previous one.
  const auto agree = [&](const Estimate& e) {
    return std::abs(plain.mean - e.mean) < 4 * std::sqrt((plain.variance + e.variance) / kSamples);
  };
  return agree(guided) && agree(product) && product.variance < guided.variance && guided.variance < plain.variance ? 0
                                                                                                                   : 1;
}
