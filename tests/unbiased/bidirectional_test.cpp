// Bidirectional path tracing that is guided in both directions, and guided path tracing with light paths, estimate the
// image of path tracing, and a wrong density of either guide is detected.

#include <fstream>

#include <oneapi/tbb/global_control.h>

#include "runtime/render/integrators/bidirectional_paths.h"
#include "tests/support/batches.h"
#include "tests/support/studio.h"

using namespace lobe;
using lobe::test::agree;
using lobe::test::Batches;
using lobe::test::PathWithLight;
using lobe::test::renderBlocks;
using lobe::test::Studio;

namespace {

constexpr const char* kRoom = R"(<scene version="3.0.0">
  <sensor type="perspective"><float name="fov" value="50"/>
    <transform name="to_world"><lookat origin="0, -6, 2.5" target="0, 0, 0.9" up="0, 0, 1"/></transform>
    <film type="hdrfilm"><rfilter type="box"/></film></sensor>
  <bsdf type="twosided" id="glossy"><bsdf type="roughconductor"><string name="distribution" value="ggx"/>
    <float name="alpha" value="0.25"/></bsdf></bsdf>
  <bsdf type="twosided" id="plastic"><bsdf type="roughplastic"><float name="alpha" value="0.3"/></bsdf></bsdf>
  <shape type="rectangle"><transform name="to_world"><scale value="3"/></transform><ref id="plastic"/></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate x="1" angle="90"/>
    <translate y="2.5"/></transform><ref id="glossy"/></shape>
  <shape type="cube"><transform name="to_world"><scale value="0.5"/><rotate z="1" angle="30"/>
    <translate x="-1.3" z="0.5"/></transform><ref id="glossy"/></shape>
  <shape type="sphere"><point name="center" x="0.8" y="-0.3" z="1"/><float name="radius" value="0.7"/>
    <bsdf type="roughdielectric"><string name="distribution" value="ggx"/><float name="alpha" value="0.25"/></bsdf></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="0.6"/><rotate x="1" angle="10"/>
    <translate x="1" z="2"/></transform><emitter type="area"><rgb name="radiance" value="9, 8, 7"/></emitter></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate x="1" angle="180"/>
    <translate z="4"/></transform><ref id="plastic"/></shape></scene>)";

Studio roomStudio(int width, int height) {
  const lobe::test::Folder folder;
  std::ofstream(folder / "room.xml") << kRoom;
  return Studio(readScene(folder / "room.xml"), width, height);
}

/// A guided sampler that reports a density too high by a factor where there is a record.
struct WrongSampler {
  const GuidedSampler& right;
  float fault;
  class Vertex {
   public:
    Vertex(const WrongSampler& sampler, const SurfaceHit& hit)
        : vertex_(sampler.right, hit), fault_(vertex_.distribution().hasRecord() ? sampler.fault : 1.0f) {}
    std::optional<BsdfSample> sample(Sampler& rng, PathStatistics& statistics) const {
      auto sample = vertex_.sample(rng, statistics);
      if (sample) sample->pdf *= fault_;
      return sample;
    }
    float pdf(const Vec3& wi) const { return vertex_.pdf(wi) * fault_; }
    std::optional<VertexEstimate> estimate() const { return vertex_.estimate(); }

   private:
    GuidedSampler::Vertex vertex_;
    float fault_;
  };
};

class WrongBdpt : public BidirectionalIntegrator {
 public:
  WrongBdpt(const Studio& studio, float camera, float light)
      : studio_(studio), camera_{studio.productSampler(), camera}, light_{studio.importanceSampler(), light} {}
  Rgb radiance(const Ray& ray, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
               std::vector<Splat>* splats) const override {
    return BidirectionalPaths(studio_.renderScene(), studio_.camera(), options_, camera_, light_)
        .radiance(ray, rng, lightRng, statistics, splats);
  }

 private:
  const Studio& studio_;
  PathOptions options_;
  WrongSampler camera_, light_;
};

}  // namespace

TEST_CASE("unbiased: bidirectional path tracing guided in both directions gives the image of path tracing", "[slow]") {
  const Studio studio = roomStudio(20, 15);
  REQUIRE(studio.illumination().records().size() > 10);
  REQUIRE(studio.importance().records() > 10);
  const RayCamera& camera = studio.camera();
  const auto path = renderBlocks(camera, studio.path(), {48, 64, 1});
  CHECK(agree(path, renderBlocks(camera, studio.guidedBdpt(), {48, 8, 100})));
  CHECK(agree(path, renderBlocks(camera, studio.productBdpt(), {48, 8, 200})));
  CHECK_FALSE(agree(path, renderBlocks(camera, WrongBdpt(studio, 1.2f, 1), {48, 8, 200})));
  CHECK_FALSE(agree(path, renderBlocks(camera, WrongBdpt(studio, 1, 1.2f), {48, 8, 200})));
}

TEST_CASE("unbiased: guided path tracing with light paths gives the image of path tracing", "[slow]") {
  const Studio studio = roomStudio(20, 15);
  const RayCamera& camera = studio.camera();
  const auto path = renderBlocks(camera, studio.path(), {48, 64, 1});
  const LightTracing tracing{2, PhotonEmission(studio.renderScene().lights)};
  const GuidedLightIntegrator product(studio.renderScene(), camera, {}, studio.productSampler(), tracing);
  CHECK(agree(path, renderBlocks(camera, product, {48, 16, 300})));
  const auto wrong = [&](float fault) {
    return PathWithLight<WrongSampler>(studio.renderScene(), camera, {}, tracing, {studio.productSampler(), fault});
  };
  CHECK(agree(path, renderBlocks(camera, wrong(1), {48, 16, 400})));
  CHECK_FALSE(agree(path, renderBlocks(camera, wrong(1.2f), {48, 16, 400})));
}

TEST_CASE("unbiased: guided bidirectional path tracing does not depend on the number of threads", "[slow]") {
  const auto renderWith = [](std::size_t threads) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    const Studio studio = roomStudio(20, 15);
    Film film(20, 15);
    GuidedBdptIntegrator bdpt = studio.productBdpt();
    lobe::render(studio.camera(), bdpt, film, {1, 8, std::nullopt});
    return film.mean();
  };
  const Image one = renderWith(1), two = renderWith(2), seven = renderWith(7);
  for (std::size_t i = 0; i < one.pixels.size(); ++i) {
    REQUIRE((one.pixels[i] == two.pixels[i]).all());
    REQUIRE((one.pixels[i] == seven.pixels[i]).all());
  }
}
