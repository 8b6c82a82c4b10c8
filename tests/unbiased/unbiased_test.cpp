// All integrators estimate the same image: they are compared with each other in blocks of pixels, and with known
// results. A sampler with a wrong density must be detected.

#include <catch2/catch.hpp>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>

#include <oneapi/tbb/global_control.h>

#include "tests/support/agreement.h"
#include "tests/support/studio.h"

using namespace lobe;
using lobe::test::agree;
using lobe::test::Block;
using lobe::test::blocks;
using lobe::test::Studio;

namespace {

/// A product sampler that reports a density 10 % too high.
struct WrongSampler {
  const GuidedSampler& right;
  class Vertex {
   public:
    Vertex(const WrongSampler& sampler, const SurfaceHit& hit) : vertex_(sampler.right, hit) {}
    std::optional<BsdfSample> sample(Sampler& rng, PathStatistics& statistics) const {
      auto sample = vertex_.sample(rng, statistics);
      if (sample && vertex_.distribution().hasRecord()) sample->pdf *= 1.1f;
      return sample;
    }
    float pdf(const Vec3& wi) const { return vertex_.pdf(wi) * (vertex_.distribution().hasRecord() ? 1.1f : 1.0f); }
    std::optional<VertexEstimate> estimate() const { return vertex_.estimate(); }

   private:
    GuidedSampler::Vertex vertex_;
  };
};

class WrongIntegrator : public Integrator {
 public:
  explicit WrongIntegrator(const Studio& studio) : scene_(studio.renderScene()), sampler_{studio.productSampler()} {}
  Rgb radiance(const Ray& ray, Sampler& rng, PathStatistics& statistics) const override {
    return PathLoop(scene_, options_, sampler_).radiance(ray, rng, statistics);
  }

 private:
  const RenderScene& scene_;
  PathOptions options_;
  WrongSampler sampler_;
};

std::vector<Block> exactly(double value, std::size_t count) {
  return std::vector<Block>(count, Block{value, 0});
}

/// Checks that all integrators agree with path tracing, and that a wrong one does not.
void checkAgreement(const Studio& studio) {
  REQUIRE(studio.illumination().records().size() > 10);
  const auto path = blocks(studio.render(studio.path(), 1024, 1), 5);
  CHECK(agree(path, blocks(studio.render(studio.guided(), 512, 2), 5)));
  CHECK(agree(path, blocks(studio.render(studio.product(), 512, 3), 5)));
  CHECK(agree(path, blocks(studio.render(studio.productWithThroughputRoulette(), 512, 5), 5)));
  CHECK_FALSE(agree(path, blocks(studio.render(WrongIntegrator(studio), 512, 4), 5)));
}

}  // namespace

TEST_CASE("unbiased: the p-value of the worst block takes the number of blocks into account") {
  const std::vector<Block> equal(10, Block{1, 0.5});
  std::vector<Block> others = equal;
  others[3].mean = 4;
  const lobe::test::ZTest test = lobe::test::zTest(equal, others);
  CHECK(test.worst == Approx(3));
  CHECK(test.p == Approx(0.02667).epsilon(0.001));
  CHECK(lobe::test::zTest(equal, equal).p == 1);
  others[3].mean = 7;
  CHECK(agree(equal, equal));
  CHECK_FALSE(agree(equal, others));
}

TEST_CASE("unbiased: all integrators agree on the demo scene", "[slow]") {
  const Studio studio(readScene(std::string(LOBE_SOURCE_DIR) + "/scenes/jewelry.xml"), 60, 40);
  REQUIRE(studio.illumination().records().size() > 100);
  const int samples = 192, size = 5;
  const auto path = blocks(studio.render(studio.path(), 2 * samples, 1), size);
  CHECK(agree(path, blocks(studio.render(studio.guided(), samples, 2), size)));
  CHECK(agree(path, blocks(studio.render(studio.product(), samples, 3), size)));
  CHECK(agree(path, blocks(studio.render(studio.productWithThroughputRoulette(), samples, 5), size)));
  CHECK_FALSE(agree(path, blocks(studio.render(WrongIntegrator(studio), samples, 4), size)));
}

TEST_CASE("unbiased: radiance in an emissive box is emission over absorption", "[slow]") {
  const lobe::test::Folder folder;
  std::ofstream(folder / "furnace.xml") << R"(<scene version="3.0.0">
    <sensor type="perspective"><float name="fov" value="70"/></sensor>
    <shape type="cube"><boolean name="flip_normals" value="true"/>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.6, 0.6"/></bsdf>
      <emitter type="area"><rgb name="radiance" value="0.8, 0.8, 0.8"/></emitter></shape></scene>)";
  const Studio studio(readScene(folder / "furnace.xml"), 30, 20);
  for (const auto& film :
       {studio.render(studio.path(), 256, 6), studio.render(studio.guided(), 256, 7),
        studio.render(studio.productWithThroughputRoulette(), 256, 9), studio.render(studio.product(), 256, 8)}) {
    const auto found = blocks(film, 5);
    CHECK(agree(found, exactly(2.0, found.size())));
  }
  CHECK(studio.illumination().records().size() > 10);
  const auto wrong = blocks(studio.render(WrongIntegrator(studio), 256, 6), 5);
  CHECK_FALSE(agree(wrong, exactly(2.0, wrong.size())));
}

namespace {

/// An environment with a broad bright spot over a dim background.
Image spotImage() {
  Image image(64, 32);
  for (int y = 0; y < 32; ++y)
    for (int x = 0; x < 64; ++x) {
      const double dx = (x - 40) / 6.0, dy = (y - 8) / 4.0;
      image.at(x, y) = grey(static_cast<float>(0.2 + 5 * std::exp(-dx * dx - dy * dy)));
    }
  return image;
}

/// ∫ ρ(wo, wi) L(wi) cosθ dω by the midpoint rule.
double reflected(const Studio& studio, const Vec3& wo) {
  const Bsdf& bsdf = *studio.scene().materials[0].bsdf;
  const int steps = 1000;
  double sum = 0;
  for (int i = 0; i < steps; ++i)
    for (int j = 0; j < 2 * steps; ++j) {
      const double z = (i + 0.5) / steps, phi = M_PI * (j + 0.5) / steps, r = std::sqrt(1 - z * z);
      const Vec3 wi(static_cast<float>(r * std::cos(phi)), static_cast<float>(r * std::sin(phi)),
                    static_cast<float>(z));
      sum += z * luminance(bsdf.eval(wo, wi, Vec2::Zero()) * studio.renderScene().lights.environmentRadiance(wi));
    }
  return sum * M_PI / (static_cast<double>(steps) * steps);
}

}  // namespace

TEST_CASE("unbiased: a glossy plate under a bright spot agrees with numerical integration", "[slow]") {
  const lobe::test::Folder folder;
  // Seen at 50° with a narrow field of view, so that wo is almost constant over the image.
  std::ofstream(folder / "plate.xml") << R"(<scene version="3.0.0">
    <sensor type="perspective"><float name="fov" value="0.5"/>
      <transform name="to_world"><lookat origin="-7.66044, 0, 6.42788" target="0, 0, 0" up="0, 0, 1"/></transform></sensor>
    <shape type="rectangle">
      <bsdf type="roughconductor"><string name="distribution" value="ggx"/><float name="alpha" value="0.25"/>
        <rgb name="eta" value="0.2, 0.2, 0.2"/><rgb name="k" value="3.9, 3.9, 3.9"/></bsdf></shape></scene>)";
  Scene scene = readScene(folder / "plate.xml");
  scene.environment = Environment{spotImage()};
  const Studio studio(std::move(scene), 20, 20);
  REQUIRE(!studio.illumination().records().empty());
  const double expected = reflected(studio, Vec3(-0.766044f, 0, 0.642788f));
  REQUIRE(expected > 0.2);
  for (const auto& film : {studio.render(studio.path(), 1024, 7), studio.render(studio.guided(), 1024, 8),
                           studio.render(studio.product(), 1024, 9)}) {
    const auto found = blocks(film, 5);
    CHECK(agree(found, exactly(expected, found.size())));
  }
  const auto wrong = blocks(studio.render(WrongIntegrator(studio), 1024, 9), 5);
  CHECK_FALSE(agree(wrong, exactly(expected, wrong.size())));
}

TEST_CASE("unbiased: all integrators agree through frosted glass on metal of varying roughness", "[slow]") {
  const lobe::test::Folder folder;
  std::ofstream(folder / "glass.xml") << R"(<scene version="3.0.0">
    <sensor type="perspective"><float name="fov" value="35"/>
      <transform name="to_world"><lookat origin="0, -6, 3" target="0, 0, 0.6" up="0, 0, 1"/></transform></sensor>
    <shape type="rectangle"><transform name="to_world"><scale value="4"/></transform>
      <bsdf type="roughconductor"><string name="distribution" value="ggx"/>
        <texture type="checkerboard" name="alpha"><float name="uscale" value="6"/><float name="vscale" value="6"/>
          <rgb name="color0" value="0.2, 0.2, 0.2"/><rgb name="color1" value="0.55, 0.55, 0.55"/></texture></bsdf></shape>
    <shape type="sphere"><point name="center" x="0" y="0" z="1"/>
      <bsdf type="roughdielectric"><string name="distribution" value="ggx"/><float name="alpha" value="0.25"/></bsdf></shape>
    <shape type="sphere"><point name="center" x="3" y="1" z="4"/>
      <emitter type="area"><rgb name="radiance" value="4, 4, 3"/></emitter></shape>
    <emitter type="constant"><rgb name="radiance" value="0.2, 0.25, 0.3"/></emitter></scene>)";
  const Studio studio(readScene(folder / "glass.xml"), 30, 20);
  checkAgreement(studio);
}

TEST_CASE("unbiased: all integrators agree on coated and thin and normal-mapped surfaces", "[slow]") {
  const lobe::test::Folder folder;
  std::ofstream(folder / "coated.xml") << R"(<scene version="3.0.0">
    <sensor type="perspective"><float name="fov" value="35"/>
      <transform name="to_world"><lookat origin="0, -6, 3" target="0, 0, 0.6" up="0, 0, 1"/></transform></sensor>
    <shape type="rectangle"><transform name="to_world"><scale value="4"/></transform>
      <bsdf type="normalmap"><texture type="checkerboard">
          <rgb name="color0" value="0.8, 0.5, 0.9"/><rgb name="color1" value="0.3, 0.9, 0.8"/></texture>
        <bsdf type="roughcoating"><float name="alpha" value="0.2"/>
          <bsdf type="roughconductor"><float name="alpha" value="0.3"/></bsdf></bsdf></bsdf></shape>
    <shape type="sphere"><point name="center" x="-1.2" y="0" z="1"/>
      <bsdf type="coating"><rgb name="sigma_a" value="0.1, 0.3, 0.6"/>
        <bsdf type="roughplastic"><float name="alpha" value="0.2"/></bsdf></bsdf></shape>
    <shape type="rectangle">
      <transform name="to_world"><rotate x="1" angle="80"/><translate x="1.4" z="1"/></transform>
      <bsdf type="principledthin"><float name="roughness" value="0.5"/><float name="spec_trans" value="0.5"/>
        <float name="diff_trans" value="0.8"/></bsdf></shape>
    <shape type="sphere"><point name="center" x="3" y="1" z="4"/>
      <emitter type="area"><rgb name="radiance" value="4, 4, 3"/></emitter></shape>
    <emitter type="constant"><rgb name="radiance" value="0.2, 0.25, 0.3"/></emitter></scene>)";
  const Studio studio(readScene(folder / "coated.xml"), 30, 20);
  checkAgreement(studio);
}

TEST_CASE("unbiased: training and rendering do not depend on the number of threads", "[slow]") {
  const auto renderWith = [](std::size_t threads) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    const Studio studio(readScene(std::string(LOBE_SOURCE_DIR) + "/scenes/jewelry.xml"), 24, 16);
    return studio.render(studio.product(), 8, 1).mean();
  };
  const Image one = renderWith(1), two = renderWith(2);
  for (std::size_t i = 0; i < one.pixels.size(); ++i) REQUIRE((one.pixels[i] == two.pixels[i]).all());
}
