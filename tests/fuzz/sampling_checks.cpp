#include "tests/fuzz/sampling_checks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <span>
#include <vector>

#include "lobe/surface_distribution.h"
#include "runtime/guiding/conversions.h"
#include "runtime/guiding/field_data.h"
#include "runtime/guiding/illumination_cache.h"
#include "schema/lobe_cache.h"

namespace lobe::fuzz {
namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

bool isDensity(float pdf) {
  return std::isfinite(pdf) && pdf >= 0;
}

constexpr int kSamples = 16;
constexpr std::array<float, 5> kCosines{1.0f, 0.7f, 0.3f, 0.01f, -0.5f};

/// The i-th of kSamples numbers in (0, 1).
float numberOf(int i) {
  return (static_cast<float>(i) + 0.5f) / kSamples;
}

/// A direction above the horizon for a number in (0, 1), and one with this cosine.
Vec3 upward(float u) {
  const float phi = 6.2831853f * u, r = std::sqrt(u);
  return {r * std::cos(phi), r * std::sin(phi), std::sqrt(1 - u)};
}
Vec3 withCosine(float cosine) {
  const float sine = std::sqrt(1 - cosine * cosine);
  return {0.6f * sine, 0.8f * sine, cosine};
}

void checkSampling(const Field& field, const ShadingPoint& point, const SurfaceReflectance& reflectance,
                   const LobeCacheSet* caches) {
  SurfaceDistribution distribution(field, point);
  if (!distribution.hasRecord()) return;
  distribution.describe(reflectance, caches);
  require(distribution.bsdfProbability() > 0 && distribution.bsdfProbability() <= 1);
  for (int i = 0; i < kSamples; ++i) {
    const float u = numberOf(i);
    require(isDensity(distribution.guidedPdf(toFloats(upward(u)))));
    float choice = u;
    const Strategy strategy = distribution.choose(choice);
    if (strategy == Strategy::bsdf) continue;
    const auto sample = distribution.sample(strategy, choice, {u, std::fmod(7 * u, 1.0f)});
    if (!sample) continue;
    require(isDensity(sample->guidedPdf));
    require(std::abs(toEigen(sample->wi).norm() - 1) < 1e-3f);
  }
}

/// One record at the origin, with normal z, whose illumination has a background and two Gaussians.
Field fixedField() {
  IlluminationRecord record{.position = Vec3::Zero(),
                            .normal = Vec3::UnitZ(),
                            .tangent = Vec3::UnitX(),
                            .radius = 1,
                            .background = 0.2f,
                            .irradiance = 1,
                            .samples = 1000,
                            .bsdfFraction = 0.2f,
                            .count = 2,
                            .components = {}};
  record.components[0] = {0.7f, 0.3f, 0.2f, {0.02f, 0.005f, 0.03f}};
  record.components[1] = {0.3f, -0.8f, 0.1f, {0.001f, 0.0f, 0.002f}};
  return fieldOf(IlluminationCache({record}, 1));
}

}  // namespace

void checkSamplingOfLobe(const std::filesystem::path& path) {
  const LobeCacheInfo info = LobeCache::open(path).info();
  const std::string name = lobeFileName(info.model, info.key);
  if (name.find('/') != std::string::npos) return;
  const std::filesystem::path renamed = path.parent_path() / name;
  std::filesystem::rename(path, renamed);
  const std::array<LobeRequest, 1> requests{{{info.model, info.key, info.modelRevision, "material"}}};
  const LobeCacheSet caches(path.parent_path(), requests, "");
  std::filesystem::remove(renamed);
  static const Field field = fixedField();
  const std::array<TintedLobe, 1> lobes{{{0, 0.8f}}};
  for (const float cosine : kCosines)
    for (const float diffuse : {0.0f, 0.3f})
      checkSampling(field, {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, toFloats(withCosine(cosine))},
                    {lobes, diffuse, 0}, &caches);
}

void checkSamplingOfField(const Field& field) {
  constexpr std::size_t kRecords = 8;
  const std::vector<IlluminationRecord> records = cacheOf(field).records();
  for (const IlluminationRecord& record : std::span(records).first(std::min(records.size(), kRecords))) {
    const ShadingPoint point{toFloats(record.position), toFloats(record.normal),
                             toFloats(record.tangent),  toFloats(Vec3(record.normal.cross(record.tangent))),
                             toFloats(record.normal),   {0.6f, 0, 0.8f}};
    checkSampling(field, point, {{}, 0.5f, 0}, nullptr);
  }
}

void checkSamplingOfMaterials(const Scene& scene) {
  const Vec2 uv(0.5f, 0.5f);
  for (const Material& material : scene.materials)
    for (const float cosine : kCosines)
      for (int i = 0; i < kSamples; ++i) {
        const float u = numberOf(i);
        const Vec3 wo = withCosine(cosine);
        require(isDensity(material.bsdf->pdf(wo, upward(u), uv)));
        const auto sample = material.bsdf->sample(wo, uv, u, {u, std::fmod(7 * u, 1.0f)});
        if (!sample) continue;
        require(isDensity(sample->pdf));
        require(std::abs(sample->wi.norm() - 1) < 1e-3f);
      }
}

}  // namespace lobe::fuzz
