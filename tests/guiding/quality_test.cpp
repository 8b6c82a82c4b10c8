// How good the distribution at a surface is, not only whether its density is right: the relative variance of one sample
// for each decision, and the accuracy of the reflected radiance. Illumination is given by the records themselves, so
// that what is measured is the use that the library makes of them.

#include <cmath>
#include <functional>
#include <numbers>

#include <catch2/catch.hpp>

#include "fitter/compile.h"
#include "lobe/surface_distribution.h"
#include "runtime/core/random.h"
#include "runtime/guiding/conversions.h"
#include "runtime/guiding/field_data.h"
#include "tests/support/fitter_test_lobes.h"
#include "tests/support/tool_run.h"

using namespace lobe;

namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kIrradiance = 2;

/// A lobe, by default a strongly anisotropic one, with its compiled cache.
class CompiledLobe {
 public:
  explicit CompiledLobe(LobePtr lobe = conductorLobe(0.04, 0.4), FitMethod method = FitMethod::wem)
      : lobe_(std::move(lobe)) {
    CompileOptions options;
    options.directory = folder_.path();
    options.directions = 256;
    options.settings.samples = 1024;
    options.settings.method = method;
    runCompile(planCompile({{lobe_, {}}}, options).front(), {});
    const std::vector<LobeRequest> requests{{lobe_->model(), lobe_->key(), lobe_->revision(), "test"}};
    caches_.emplace(folder_.path(), requests, "");
  }
  const Lobe& lobe() const { return *lobe_; }
  const LobeCacheSet& caches() const { return *caches_; }

 private:
  test::Folder folder_;
  LobePtr lobe_;
  std::optional<LobeCacheSet> caches_;
};

/// A record at the origin that a light of some shape has been learnt in.
IlluminationRecord recordOfLight() {
  IlluminationRecord r{};
  r.normal = Vec3::UnitZ();
  r.tangent = Vec3(std::cos(1.2f), std::sin(1.2f), 0);
  r.radius = 1;
  r.background = 0.2f;
  r.irradiance = kIrradiance;
  r.samples = 1000;
  r.bsdfFraction = kInitialBsdfFraction;
  r.count = 2;
  r.components[0] = {0.6f, 0.35f, 0.3f, {0.02f, 0.004f, 0.04f}};
  r.components[1] = {0.4f, -0.5f, 0.1f, {0.05f, 0.0f, 0.01f}};
  return r;
}

/// L cosθ of the light that the record describes exactly, for a world direction above the plane z = 0.
float lightOf(const IlluminationRecord& r, const Vec3& wi) {
  const Vec3 bitangent = r.normal.cross(r.tangent);
  const Vec3 local(wi.dot(r.tangent), wi.dot(bitangent), wi.dot(r.normal));
  const float background = r.background * 2 / kPi * local.z();
  // dω = 2 dA
  return r.irradiance * 0.5f * (background + (1 - r.background) * mixturePdf(r.gaussians(), toDisc(local)));
}

/// A shading frame that is turned about the normal.
ShadingPoint pointTurned(float angle, const Vec3& wo) {
  const float c = std::cos(angle), s = std::sin(angle);
  return {{0, 0, 0}, {0, 0, 1}, {c, s, 0}, {-s, c, 0}, {0, 0, 1}, toFloats(wo)};
}

Vec3 toWorld(const ShadingPoint& point, const Vec3& v) {
  return toEigen(point.s) * v.x() + toEigen(point.t) * v.y() + toEigen(point.n) * v.z();
}

struct Outcome {
  double mean, relativeVariance;  // of one sample; the mean is what the surface reflects
};

/// Samples of ρ L cosθ over the density of the distribution; light takes a world direction.
Outcome sampled(const SurfaceDistribution& guide, const ShadingPoint& point, const Lobe& lobe,
                const std::function<float(const Vec3&)>& light) {
  constexpr int kSamples = 40000;
  const Vec3 wo = toEigen(point.wo);
  Rng rng(11);
  double sum = 0, squares = 0;
  for (int i = 0; i < kSamples; ++i) {
    float choice = rng.uniform();
    const Vec2 u = rng.uniform2();
    const Strategy strategy = guide.choose(choice);
    Vec3 wi = Vec3::Zero();
    if (strategy == Strategy::bsdf) {
      if (const auto drawn = lobe.sample(wo, u)) wi = drawn->wi;
    } else if (const auto drawn = guide.sample(strategy, choice, toFloats(u))) {
      wi = toEigen(drawn->wi);
    }
    if (wi.z() <= 0) continue;
    const double pdf = guide.bsdfProbability() * lobe.pdf(wo, wi) + guide.guidedPdf(toFloats(wi));
    const double value = lobe.eval(wo, wi) * light(toWorld(point, wi)) / pdf;
    sum += value;
    squares += value * value;
  }
  const double mean = sum / kSamples;
  return {mean, squares / kSamples / (mean * mean) - 1};
}

SurfaceReflectance onlyLobe(const TintedLobe& lobe) {
  return {.lobes = {&lobe, 1}, .diffuseAlbedo = 0};
}

constexpr TintedLobe kWhole{0, 1};

}  // namespace

TEST_CASE("quality: the product follows an anisotropic lobe whatever the shading frame") {
  const CompiledLobe compiled;
  const IlluminationRecord record = recordOfLight();
  const Field field = fieldOf(IlluminationCache({record}, 1));
  const auto light = [&](const Vec3& wi) { return lightOf(record, wi); };
  for (const float turn : {0.0f, 0.7f, 1.6f, 2.5f, 4.0f}) {
    CAPTURE(turn);
    const ShadingPoint point = pointTurned(turn, direction(35, 40));
    SurfaceDistribution product(field, point), guided(field, point);
    product.describe(onlyLobe(kWhole), &compiled.caches());
    guided.describe(onlyLobe(kWhole), nullptr);
    REQUIRE(product.decision() == GuidingDecision::product);
    const Outcome byProduct = sampled(product, point, compiled.lobe(), light);
    CHECK(byProduct.relativeVariance < 0.25);
    CHECK(byProduct.relativeVariance < 0.4 * sampled(guided, point, compiled.lobe(), light).relativeVariance);
    // reflectedRadiance is up to one factor for all points; here it is one, because the irradiance is the true one.
    REQUIRE(product.reflectedRadiance(0));
    CHECK(*product.reflectedRadiance(0) == Approx(byProduct.mean).epsilon(0.1));
  }
}

TEST_CASE("quality: records that have seen few particles leave half of the samples to the BSDF") {
  const CompiledLobe compiled;
  // What it has learnt so far is far from the light, which is uniform, and so is its BSDF sampling fraction.
  IlluminationRecord record = recordOfLight();
  record.samples = 10;
  record.background = 0;
  record.bsdfFraction = 0.02f;
  record.count = 1;
  record.components[0] = {1.0f, 0.7f, 0.5f, {1e-3f, 0.0f, 1e-3f}};
  const Field field = fieldOf(IlluminationCache({record}, 1));
  const ShadingPoint point = pointTurned(0.3f, direction(35, 40));
  SurfaceDistribution guide(field, point);
  guide.describe(onlyLobe(kWhole), &compiled.caches());
  CHECK(guide.decision() == GuidingDecision::undersampled);
  const auto uniform = [](const Vec3& wi) { return wi.z(); };
  CHECK(sampled(guide, point, compiled.lobe(), uniform).relativeVariance < 1.5);
}

TEST_CASE("quality: uniform light is sampled by the BSDF alone") {
  const CompiledLobe compiled;
  IlluminationRecord record = recordOfLight();
  record.background = 0.99f;
  const Field field = fieldOf(IlluminationCache({record}, 1));
  const ShadingPoint point = pointTurned(0.3f, direction(35, 40));
  SurfaceDistribution guide(field, point);
  guide.describe(onlyLobe(kWhole), &compiled.caches());
  CHECK(guide.decision() == GuidingDecision::uniform);
  const auto light = [&](const Vec3& wi) { return lightOf(record, wi); };
  CHECK(sampled(guide, point, compiled.lobe(), light).relativeVariance < 0.3);
}

TEST_CASE(
    "quality: the reflected radiance of guiding by illumination is that of a diffuse surface of the same albedo") {
  const Field field = fieldOf(IlluminationCache({recordOfLight()}, 1));
  for (const float albedo : {0.1f, 0.5f, 0.9f}) {
    SurfaceDistribution guide(field, pointTurned(0, direction(35)));
    guide.describe({.lobes = {}, .diffuseAlbedo = albedo}, nullptr);
    REQUIRE(guide.reflectedRadiance(albedo));
    CHECK(*guide.reflectedRadiance(albedo) == Approx(albedo / kPi * kIrradiance).epsilon(1e-4));
  }
}

TEST_CASE(
    "quality: light reflected by a lobe too narrow for mixtures is left to the BSDF, and is part of the estimate") {
  const CompiledLobe narrow(conductorLobe(1e-3, 1e-3), FitMethod::automatic);
  const Field field = fieldOf(IlluminationCache({recordOfLight()}, 1));
  const ShadingPoint point = pointTurned(0.3f, direction(35, 40));
  constexpr float kDiffuse = 0.5f, kTint = 0.4f;
  const TintedLobe lobe{0, kTint};
  SurfaceDistribution diffuse(field, point), both(field, point);
  diffuse.describe({.lobes = {}, .diffuseAlbedo = kDiffuse}, &narrow.caches());
  both.describe({.lobes = {&lobe, 1}, .diffuseAlbedo = kDiffuse}, &narrow.caches());
  REQUIRE(both.decision() == GuidingDecision::illumination);
  REQUIRE(diffuse.reflectedRadiance(0));
  REQUIRE(both.reflectedRadiance(0));
  const float more = (*both.reflectedRadiance(0) - *diffuse.reflectedRadiance(0)) / (kIrradiance / kPi);
  CHECK(more > 0.5f * kTint);
  CHECK(more < 1.001f * kTint);  // the lobe's albedo is at most one
  CHECK((1 - both.bsdfProbability()) / (1 - diffuse.bsdfProbability()) ==
        Approx(kDiffuse / (kDiffuse + more)).epsilon(1e-3));
}

TEST_CASE("quality: the region that a record serves shrinks where parallax moves narrow light") {
  // A narrow beam whose source is near or far: the angle by which it moves between two points depends on the distance.
  const auto meanRadius = [](float distance) {
    FieldOptions options;
    options.sceneDiagonal = 10;
    options.unitFraction = 0.1f;
    Field field(options);
    for (int pass = 0; pass < 6; ++pass) {
      SampleStorage storage;
      for (std::uint64_t i = 0; i < 3000; ++i) {
        Rng rng(3, static_cast<std::uint64_t>(pass), i);
        const Vec3 position(4 * rng.uniform(), 4 * rng.uniform(), 0);
        const Vec3 direction = Vec3(0.3f + 0.01f * rng.uniform(), 0.01f * rng.uniform(), 0.9f).normalized();
        storage.beginPath(i);
        storage.addPhoton(toFloats(position), {0, 0, 1}, toFloats(direction), 1, distance, 1);
        storage.requestRecord(toFloats(position), {0, 0, 1});
      }
      field.update(storage);
    }
    double sum = 0;
    const std::vector<IlluminationRecord> records = cacheOf(field).records();
    for (const IlluminationRecord& r : records) sum += r.radius;
    return sum / static_cast<double>(records.size());
  };
  const double near = meanRadius(0.5f), far = meanRadius(50);
  INFO("mean radius " << near << " near, " << far << " far");
  CHECK(far > 0.5);
  CHECK(near < 0.5 * far);
}
