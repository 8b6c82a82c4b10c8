// Densities of bidirectional paths: wrong ones of each technique are detected, and that of the camera has a closed
// form.

#include <optional>
#include <vector>

#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "runtime/render/integrators/bidirectional_paths.h"
#include "tests/support/bidirectional_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

/// Samples like the BSDF, and reports a density that is wrong by a factor.
struct WrongGuide {
  float fault;
  class Vertex {
   public:
    Vertex(const WrongGuide& guide, const SurfaceHit& hit) : fault_(guide.fault), right_(BsdfSampler(), hit) {}
    std::optional<BsdfSample> sample(Sampler& rng, PathStatistics& statistics) const {
      auto sample = right_.sample(rng, statistics);
      if (sample) sample->pdf *= fault_;
      return sample;
    }
    float pdf(const Vec3& wi) const { return fault_ * right_.pdf(wi); }
    static std::optional<VertexEstimate> estimate() { return std::nullopt; }

   private:
    float fault_;
    BsdfSampler::Vertex right_;
  };
};

class WrongBdpt : public BidirectionalIntegrator {
 public:
  WrongBdpt(const Stage& stage, float camera, float light) : stage_(stage), camera_{camera}, light_{light} {}
  Rgb radiance(const Ray& ray, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
               std::vector<Splat>* splats) const override {
    return BidirectionalPaths(stage_.ready, stage_.camera, stage_.options, camera_, light_)
        .radiance(ray, rng, lightRng, statistics, splats);
  }

 private:
  const Stage& stage_;
  WrongGuide camera_, light_;
};

}  // namespace

TEST_CASE("bidirectional: a wrong density of either subpath is detected") {
  const Stage stage(sceneWith(std::string(kFloor) + kLamp));
  const auto path = renderBlocks(stage, stage.path(), {48, 24, 1});
  CHECK(agree(path, renderBlocks(stage, WrongBdpt(stage, 1, 1), {48, 12, 1000})));
  CHECK_FALSE(agree(path, renderBlocks(stage, WrongBdpt(stage, 1.2f, 1), {48, 12, 1000})));
  CHECK_FALSE(agree(path, renderBlocks(stage, WrongBdpt(stage, 1, 1.2f), {48, 12, 1000})));
}

TEST_CASE("light paths: a wrong density of any technique is detected", "[heavy]") {
  // The ball makes caustics; the environment is sampled through it, too.
  const Stage stage(sceneWith(std::string(kFloor) + kLamp + R"(
    <shape type="sphere"><point name="center" x="0.8" y="-0.3" z="1"/><float name="radius" value="0.9"/>
      <bsdf type="dielectric"/></shape>
    <emitter type="constant"><rgb name="radiance" value="0.3, 0.3, 0.3"/></emitter>)"));
  const auto path = renderBlocks(stage, stage.path(), {48, 160, 1});
  const LightTracing tracing{1, PhotonEmission(stage.ready.lights)};
  using Wrong = PathWithLight<WrongGuide, WrongGuide>;
  const auto blocksOf = [&](float camera, float light) {
    return renderBlocks(stage, Wrong(stage.ready, stage.camera, stage.options, tracing, {camera}, {light}),
                        {48, 24, 1000});
  };
  CHECK(agree(path, blocksOf(1, 1)));
  CHECK_FALSE(agree(path, blocksOf(1.2f, 1)));
  CHECK_FALSE(agree(path, blocksOf(1, 2.0f)));
}

TEST_CASE("bidirectional: the density of a camera is the inverse of the area that a pixel covers") {
  Camera camera;
  camera.width = 20, camera.height = 15;
  camera.kind = GENERATE(Camera::Kind::perspective, Camera::Kind::thinlens, Camera::Kind::orthographic);
  camera.apertureRadius = 0.3f, camera.focusDistance = 2;
  camera.toWorld.topLeftCorner<3, 3>() =
      Eigen::AngleAxisf(0.4f, Vec3(1, 2, 3).normalized()).toRotationMatrix() * Eigen::Scaling(1.5f, 1.0f, 2.0f);
  camera.toWorld.topRightCorner<3, 1>() = Vec3(3, -1, 2);
  const RayCamera rays(camera, {});
  const Vec2 lens(0.3f, -0.5f), film(13.2f, 4.7f);
  const Ray ray = rays.rayThrough(film, lens);
  const float distance = 4;
  const Vec3 point = ray.origin + distance * ray.direction;
  const auto view = rays.view(point, lens);
  REQUIRE(view);
  CHECK((view->film - film).norm() < 1e-3f);
  CHECK(view->ray.direction.isApprox(ray.direction, 1e-5f));
  CHECK(view->ray.tfar == Approx(distance).epsilon(1e-4));
  // Where the rays through nearby image points meet the plane through the point, perpendicular to the ray.
  const auto meet = [&](const Vec2& p) {
    const Ray r = rays.rayThrough(p, lens);
    return Vec3(r.origin + r.direction * ((point - r.origin).dot(ray.direction) / r.direction.dot(ray.direction)));
  };
  const float h = 0.05f;
  const Vec3 dx = (meet(film + Vec2(h, 0)) - meet(film - Vec2(h, 0))) / (2 * h);
  const Vec3 dy = (meet(film + Vec2(0, h)) - meet(film - Vec2(0, h))) / (2 * h);
  CHECK(view->density == Approx(1 / dx.cross(dy).norm()).epsilon(1e-2));
  CHECK(rays.density(ray, distance) == Approx(view->density).epsilon(1e-4));
}
