// Rendering with normal maps, compared with integrals over the hemisphere.

#include "materials/registry.h"
#include "tests/support/render_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

/// A floor that faces +z with the tangent +x, under a constant sky of radiance 1.
struct Floor {
  explicit Floor(BsdfPtr bsdf) {
    addShape(scene, rectangle({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), addMaterial(scene, std::move(bsdf)));
    scene.environment = environment(Image(4, 2, grey(1.0f)));
  }
  Scene scene;
};

/// A normal map whose normal is tilted by the angle towards +x.
BsdfPtr mapOf(double degrees, bool flips, bool shadows) {
  const double angle = degrees * std::numbers::pi / 180.0;
  const Rgb colour(static_cast<float>(0.5 + 0.5 * std::sin(angle)), 0.5f,
                   static_cast<float>(0.5 + 0.5 * std::cos(angle)));
  Parameters diffuse, map;
  diffuse.set("reflectance", 1.0);
  map.set("normalmap", constantTexture(colour));
  map.set("flip_invalid_normals", flips);
  map.set("use_shadowing_function", shadows);
  map.addChild(makeBsdf("diffuse", diffuse));
  return makeBsdf("normalmap", map);
}

BsdfPtr masked(double opacity, BsdfPtr nested) {
  Parameters mask;
  mask.set("opacity", opacity);
  mask.addChild(std::move(nested));
  return makeBsdf("mask", mask);
}

/// The radiance of a white diffuse surface with a normal tilted by the angle under a sky of radiance 1: ∫ cosθ/π times
/// shadowing over directions above both the floor and the mapped surface. Without shadowing it is (1 + cos) / 2.
double reflected(double degrees, bool shadows) {
  const double angle = degrees * std::numbers::pi / 180.0;
  const Eigen::Vector3d n(std::sin(angle), 0.0, std::cos(angle));
  const double alpha2 = shadows ? std::min(1.0, std::pow(std::tan(angle), 2) / 8.0) : 0.0;
  constexpr int kSteps = 1000;
  double sum = 0.0;
  for (int i = 0; i < kSteps; ++i)
    for (int j = 0; j < kSteps; ++j) {
      const double z = (i + 0.5) / kSteps, phi = std::numbers::pi * (j + 0.5) / kSteps, r = std::sqrt(1.0 - z * z);
      const double cosine = n.dot(Eigen::Vector3d(r * std::cos(phi), 0.0, z));
      sum += std::max(0.0, cosine) * 2.0 / (1.0 + std::sqrt(1.0 + alpha2 * (1.0 - z * z) / (z * z)));
    }
  return 2.0 * sum / (static_cast<double>(kSteps) * kSteps);
}

/// Radiance along a ray to the floor's centre from the direction `towards`.
Moments seenFrom(const Floor& floor, const Vec3& towards) {
  const RenderScene ready(floor.scene);
  return estimate(PathIntegrator(ready, {}), {2.0f * towards, -towards}, 20000);
}

const Vec3 kFacing = Vec3(0.9f, 0.1f, 0.3f).normalized();
const Vec3 kAverted = Vec3(-0.9f, 0.1f, 0.3f).normalized();

}  // namespace

TEST_CASE("render: the radiance of a normal-mapped surface agrees with numerical integration") {
  for (const double degrees : {0.0, 20.0, 50.0, 75.0})
    for (const bool shadows : {false, true}) {
      INFO(degrees << " degrees, shadowing " << shadows);
      const double expected = reflected(degrees, shadows);
      if (!shadows) CHECK(expected == Approx(0.5 + 0.5 * std::cos(degrees * std::numbers::pi / 180.0)).epsilon(1e-3));
      CHECK(deviation(seenFrom(Floor(mapOf(degrees, true, shadows)), kFacing), expected) < kMaxDeviation);
    }
}

TEST_CASE("render: a mapped normal that faces away is black or flipped") {
  CHECK(seenFrom(Floor(mapOf(50.0, false, false)), kAverted).mean() == 0.0);
  CHECK(deviation(seenFrom(Floor(mapOf(50.0, true, true)), kAverted), reflected(50.0, true)) < kMaxDeviation);
}

TEST_CASE("render: a transparent mask shows what is behind it, whatever the normals of its nested map") {
  for (const double degrees : {20.0, 50.0, 75.0})
    for (const bool flips : {false, true})
      for (const bool shadows : {false, true})
        for (const Vec3& towards : {kFacing, kAverted})
          CHECK(deviation(seenFrom(Floor(masked(0.0, mapOf(degrees, flips, shadows))), towards), 1.0) < kMaxDeviation);
  // Half of the light passes, also from where the map would be black.
  CHECK(seenFrom(Floor(masked(0.5, mapOf(50.0, false, false))), kAverted).mean() > 0.4);
  // Opaque points keep the mapped normal.
  CHECK(seenFrom(Floor(masked(1.0, mapOf(50.0, false, false))), kAverted).mean() == 0.0);
}

TEST_CASE("render: invisible surfaces let light pass, whatever their vertex normals are") {
  for (const BsdfPtr& bsdf : {makeBsdf("null", {}), masked(0.0, makeBsdf("diffuse", {}))}) {
    Floor floor(bsdf);
    auto& mesh = std::get<TriangleMesh>(floor.scene.shapes[0].geometry);
    mesh.normals.assign(mesh.positions.size(), Vec3(std::sin(0.9f), 0, std::cos(0.9f)));
    CHECK(seenFrom(floor, kAverted).mean() == Approx(1.0));
    CHECK(seenFrom(floor, kFacing).mean() == Approx(1.0));
  }
}

TEST_CASE("render: shadowing at the terminator scales BSDF values and samples alike") {
  const auto hitOf = [](const Scene& scene) {
    return *RayTracer(scene).trace({Vec3(0.1f, 0.0f, 1.0f), Vec3(0.0f, 0.0f, -1.0f)});
  };
  const Floor floor(mapOf(45.0, true, true));
  const SurfaceHit hit = hitOf(floor.scene);
  CHECK(hit.terminatorRoughness2 == Approx(0.125f));
  const Vec3 wi = Vec3(0.5f, 0.3f, 0.2f).normalized();
  const double tangent2 = (0.25 + 0.09) / 0.04;
  const double shadowing = 2.0 / (1.0 + std::sqrt(1.0 + 0.125 * tangent2));
  CHECK(evalBsdf(hit, hit.frame.toLocal(wi)).x() == Approx(shadowing * kInvPi).epsilon(1e-4));
  const auto sample = sampleBsdf(hit, 0.5f, Vec2(0.4f, 0.7f));
  REQUIRE(sample);
  CHECK(sample->f.isApprox(evalBsdf(hit, sample->wi)));
  CHECK(sample->pdf == hit.bsdf->pdf(hit.wo, sample->wi, hit.uv));
  CHECK(hitOf(Floor(mapOf(80.0, true, true)).scene).terminatorRoughness2 == 1.0f);
  CHECK(hitOf(Floor(mapOf(80.0, true, false)).scene).terminatorRoughness2 == 0.0f);
}
