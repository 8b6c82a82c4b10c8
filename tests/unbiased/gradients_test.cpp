// Gradient-domain path tracing and bidirectional path tracing estimate the same picture as path tracing: their
// reconstruction in L2, and the differences of neighbouring pixels, agree with those of path tracing. A wrong density
// must be detected.

#include <catch2/catch.hpp>

#include <cmath>
#include <fstream>
#include <functional>

#include <oneapi/tbb/global_control.h>

#include "runtime/render/gradients/gradient_bidirectional_path.h"
#include "runtime/render/gradients/gradient_integrator.h"
#include "runtime/render/gradients/gradient_path.h"
#include "tests/support/agreement.h"
#include "tests/support/batches.h"
#include "tests/support/studio.h"

using namespace lobe;
using lobe::test::agree;
using lobe::test::Block;
using lobe::test::Stage;
using lobe::test::Studio;

namespace {

constexpr int kBlock = 5;
constexpr int kRepetitions = 24;

/// Values whose means and variances are estimated from repetitions with different seeds.
class Repeated {
 public:
  void add(const std::vector<double>& values) {
    sums_.resize(values.size()), squares_.resize(values.size());
    for (std::size_t i = 0; i < values.size(); ++i) sums_[i] += values[i], squares_[i] += values[i] * values[i];
    ++n_;
  }
  std::vector<Block> blocks() const {
    std::vector<Block> result;
    for (std::size_t i = 0; i < sums_.size(); ++i) {
      const double mean = sums_[i] / n_;
      result.push_back({mean, (squares_[i] / n_ - mean * mean) / (n_ - 1)});
    }
    return result;
  }

 private:
  std::vector<double> sums_, squares_;
  double n_ = 0;
};

/// The means of an image over blocks, weighted by `weight` of column and row.
std::vector<double> blockMeans(const Image& image, const std::function<double(int, int)>& weight) {
  std::vector<double> all;
  for (int y0 = 0; y0 + kBlock <= image.height; y0 += kBlock)
    for (int x0 = 0; x0 + kBlock <= image.width; x0 += kBlock) {
      double sum = 0;
      for (int y = y0; y < y0 + kBlock; ++y)
        for (int x = x0; x < x0 + kBlock; ++x) sum += weight(x, y) * image.at(x, y).mean() / (kBlock * kBlock);
      all.push_back(sum);
    }
  return all;
}

double one(int, int) {
  return 1;
}

/// The differences of an image from its right and lower neighbours.
Image differences(const Image& image, int stepX, int stepY) {
  Image result(image.width, image.height);
  for (int y = 0; y + stepY < image.height; ++y)
    for (int x = 0; x + stepX < image.width; ++x) result.at(x, y) = image.at(x + stepX, y + stepY) - image.at(x, y);
  return result;
}

Image sum(Image a, const Image& b) {
  for (std::size_t i = 0; i < a.pixels.size(); ++i) a.pixels[i] += b.pixels[i];
  return a;
}

struct Estimates {
  Repeated image, dx, dy;

  void add(const Image& pixels, const Image& right, const Image& down) {
    // Without the signs, all differences but those at the sides of a block would cancel.
    const auto sign = [](int x, int y) { return (x * 7 + y * 13) % 5 < 2 ? -1.0 : 1.0; };
    image.add(blockMeans(pixels, one));
    dx.add(blockMeans(right, sign));
    dy.add(blockMeans(down, sign));
  }
};

/// Of an integrator without gradients.
template <class AnyIntegrator>
Estimates ofPixels(const RayCamera& camera, AnyIntegrator integrator, int samples) {
  Estimates all;
  for (int i = 0; i < kRepetitions; ++i) {
    Film film(camera.width(), camera.height());
    render(camera, integrator, film, {static_cast<std::uint64_t>(1000 + i), samples, std::nullopt});
    const Image image = film.mean();
    all.add(image, differences(image, 1, 0), differences(image, 0, 1));
  }
  return all;
}

template <class AnyIntegrator>
Estimates ofGradients(const RayCamera& camera, const AnyIntegrator& integrator, int samples) {
  Estimates all;
  for (int i = 0; i < kRepetitions; ++i) {
    GradientFilm film(camera.width(), camera.height());
    render(camera, integrator, film, {static_cast<std::uint64_t>(2000 + i), samples, std::nullopt});
    REQUIRE(film.pixels().dropped() == 0);
    // Negative pixels are not clamped, as in the pictures that the tool writes: that would be a bias.
    const Image seen = film.visible();
    all.add(sum(reconstruct(film.mean(), film.dx(), film.dy(), ReconstructionNorm::l2), seen),
            sum(film.dx(), differences(seen, 1, 0)), sum(film.dy(), differences(seen, 0, 1)));
  }
  return all;
}

bool agree(const Estimates& a, const Estimates& b) {
  return agree(a.image.blocks(), b.image.blocks()) && agree(a.dx.blocks(), b.dx.blocks()) &&
         agree(a.dy.blocks(), b.dy.blocks());
}

/// A sampler that reports a density too high by a factor.
struct WrongSampler {
  float fault = 1.05f;
  class Vertex {
   public:
    Vertex(const WrongSampler& sampler, const SurfaceHit& hit) : fault_(sampler.fault), vertex_(BsdfSampler(), hit) {}
    std::optional<BsdfSample> sample(Sampler& rng, PathStatistics& statistics) const {
      auto sample = vertex_.sample(rng, statistics);
      if (sample) sample->pdf *= fault_;
      return sample;
    }
    float pdf(const Vec3& wi) const { return fault_ * vertex_.pdf(wi); }

   private:
    float fault_;
    BsdfSampler::Vertex vertex_;
  };
};

class WrongGradients : public GradientIntegrator {
 public:
  explicit WrongGradients(const Studio& studio) : studio_(studio) {}
  GradientSample sample(int x, int y, Sampler& rng, PathStatistics& statistics) const override {
    const WrongSampler sampler;
    const PathOptions options;
    const GradientContext<WrongSampler> context{studio_.renderScene(), studio_.camera(), options, sampler};
    return GradientPath(context, rng, statistics).trace(x, y);
  }

 private:
  const Studio& studio_;
};

void check(const std::string& scene) {
  const lobe::test::Folder folder;
  std::ofstream(folder / "scene.xml") << R"(<scene version="3.0.0">
    <sensor type="perspective"><float name="fov" value="35"/>
      <transform name="to_world"><lookat origin="0, -6, 3" target="0, 0, 0.6" up="0, 0, 1"/></transform></sensor>)"
                                      << scene << "</scene>";
  const Studio studio(readScene(folder / "scene.xml"), 30, 20);
  const RayCamera& camera = studio.camera();
  const Estimates path = ofPixels(camera, studio.path(), 128);
  const PathGradients gradients(studio.renderScene(), studio.camera(), {});
  CHECK(agree(path, ofGradients(camera, gradients, 32)));
  const GuidedGradients product(studio.renderScene(), studio.camera(), {}, studio.productSampler());
  CHECK(agree(path, ofGradients(camera, product, 32)));
  CHECK_FALSE(agree(path, ofGradients(camera, WrongGradients(studio), 32)));
}

const std::string kLamp = R"(<shape type="rectangle"><transform name="to_world"><scale value="0.8"/>
    <rotate x="1" angle="180"/><translate x="1" y="-1" z="4"/></transform>
    <emitter type="area"><rgb name="radiance" value="12, 12, 9"/></emitter></shape>)";
const std::string kWalls = R"(<shape type="rectangle"><transform name="to_world"><scale value="4"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.7, 0.6, 0.5"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="4"/><rotate x="1" angle="90"/>
      <translate y="2" z="1"/></transform><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>)";

}  // namespace

TEST_CASE("unbiased: gradients of diffuse boxes under a lamp", "[slow][gradients]") {
  check(kLamp + kWalls + R"(<shape type="cube"><transform name="to_world"><scale value="0.6"/>
      <rotate z="1" angle="25"/><translate x="-0.8" z="0.6"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.3, 0.8, 0.3"/></bsdf></shape>)");
}

TEST_CASE("unbiased: gradients of glossy surfaces under a lamp", "[slow][gradients]") {
  check(kLamp + R"(<shape type="rectangle"><transform name="to_world"><scale value="4"/></transform>
      <bsdf type="roughconductor"><string name="distribution" value="ggx"/>
        <texture type="checkerboard" name="alpha"><float name="uscale" value="6"/><float name="vscale" value="6"/>
          <rgb name="color0" value="0.1, 0.1, 0.1"/><rgb name="color1" value="0.4, 0.4, 0.4"/></texture></bsdf></shape>
    <shape type="sphere"><point name="center" x="-1" y="0" z="1"/>
      <bsdf type="roughconductor"><float name="alpha" value="0.01"/></bsdf></shape>
    <shape type="sphere"><point name="center" x="0.3" y="-1.2" z="0.5"/><float name="radius" value="0.5"/>
      <bsdf type="roughplastic"><float name="alpha" value="0.1"/></bsdf></shape>
    <shape type="sphere"><point name="center" x="1.2" y="0.4" z="1"/>
      <bsdf type="plastic"><rgb name="diffuse_reflectance" value="0.2, 0.3, 0.7"/></bsdf></shape>)");
}

TEST_CASE("unbiased: gradients of smooth and frosted glass", "[slow][gradients]") {
  check(kLamp + kWalls + R"(<shape type="sphere"><point name="center" x="-1.1" y="0" z="1"/>
      <bsdf type="dielectric"/></shape>
    <shape type="sphere"><point name="center" x="1.1" y="0" z="1"/>
      <bsdf type="roughdielectric"><string name="distribution" value="ggx"/><float name="alpha" value="0.15"/></bsdf></shape>
    <shape type="sphere"><point name="center" x="0" y="-0.8" z="0.5"/><float name="radius" value="0.5"/>
      <bsdf type="roughdielectric"><float name="alpha" value="0.01"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.7"/><rotate x="1" angle="80"/>
      <translate y="-2" z="0.8"/></transform><bsdf type="thindielectric"/></shape>)");
}

TEST_CASE("unbiased: gradients of coated, masked and thin surfaces under an environment", "[slow][gradients]") {
  check(R"(<emitter type="constant"><rgb name="radiance" value="0.4, 0.5, 0.6"/></emitter>
    <emitter type="directional"><vector name="direction" x="1" y="1" z="-2"/><rgb name="irradiance" value="1, 1, 1"/></emitter>
    <shape type="rectangle"><transform name="to_world"><scale value="4"/></transform>
      <bsdf type="normalmap"><texture type="checkerboard">
          <rgb name="color0" value="0.8, 0.5, 0.9"/><rgb name="color1" value="0.3, 0.9, 0.8"/></texture>
        <bsdf type="roughcoating"><float name="alpha" value="0.2"/>
          <bsdf type="roughconductor"><float name="alpha" value="0.3"/></bsdf></bsdf></bsdf></shape>
    <shape type="sphere"><point name="center" x="-1.2" y="0" z="1"/>
      <bsdf type="coating"><rgb name="sigma_a" value="0.1, 0.3, 0.6"/>
        <bsdf type="roughplastic"><float name="alpha" value="0.2"/></bsdf></bsdf></shape>
    <shape type="sphere"><point name="center" x="0.2" y="-1.5" z="0.5"/><float name="radius" value="0.5"/>
      <bsdf type="mask"><float name="opacity" value="0.6"/><bsdf type="twosided"><bsdf type="conductor"/></bsdf></bsdf></shape>
    <shape type="rectangle">
      <transform name="to_world"><rotate x="1" angle="80"/><translate x="1.4" z="1"/></transform>
      <bsdf type="principledthin"><float name="roughness" value="0.3"/><float name="spec_trans" value="0.5"/>
        <float name="diff_trans" value="0.8"/></bsdf></shape>)");
}

// ---- Bidirectional path tracing

namespace {

Scene smallScene(const std::string& body, const std::string& filter = "box") {
  const lobe::test::Folder folder;
  std::ofstream(folder / "scene.xml") << R"(<scene version="3.0.0">
    <sensor type="perspective"><float name="fov" value="35"/>
      <transform name="to_world"><lookat origin="0, -6, 3" target="0, 0, 0.6" up="0, 0, 1"/></transform>
      <film type="hdrfilm"><integer name="width" value="30"/><integer name="height" value="20"/>
        <rfilter type=")" << filter << R"("/></film></sensor>)"
                                      << body << "</scene>";
  return readScene(folder / "scene.xml");
}

// Albedos that differ much between neighbouring pixels, so that weights that do not sum to one would change
// differences.
const std::string kCheckered = R"(<bsdf type="twosided" id="checkered"><bsdf type="diffuse">
      <texture type="checkerboard" name="reflectance"><float name="uscale" value="20"/><float name="vscale" value="20"/>
        <rgb name="color0" value="0.9, 0.8, 0.7"/><rgb name="color1" value="0.05, 0.1, 0.1"/></texture></bsdf></bsdf>
    <shape type="rectangle"><transform name="to_world"><scale value="4"/></transform><ref id="checkered"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="4"/><rotate x="1" angle="90"/>
      <translate y="2" z="1"/></transform><ref id="checkered"/></shape>)";

class WrongBdptGradients : public BidirectionalGradientIntegrator {
 public:
  WrongBdptGradients(const Stage& stage, float camera, float light) : stage_(stage), camera_{camera}, light_{light} {}
  GradientSample sample(int x, int y, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
                        GradientSplats splats) const override {
    const GradientContext<WrongSampler> context{stage_.ready, stage_.camera, stage_.options, camera_};
    return GradientBidirectionalPath(context, light_, rng, statistics).trace(x, y, lightRng, splats);
  }

 private:
  const Stage& stage_;
  WrongSampler camera_, light_;
};

void checkBdpt(Scene scene, int samplesOfPath, int samples) {
  const Stage stage(std::move(scene));
  const Estimates gradients =
      ofGradients(stage.camera, BdptGradients(stage.ready, stage.camera, stage.options), samples);
  CHECK(agree(ofPixels(stage.camera, stage.bdpt(), 2 * samples), gradients));
  CHECK(agree(ofPixels(stage.camera, stage.path(), samplesOfPath), gradients));
}

const std::string kBox = R"(<shape type="cube"><transform name="to_world"><scale value="0.6"/>
      <rotate z="1" angle="25"/><translate x="-0.8" z="0.6"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.3, 0.8, 0.3"/></bsdf></shape>)";

}  // namespace

TEST_CASE("unbiased: bidirectional gradients of a diffuse box between checkered walls", "[slow][gradients]") {
  checkBdpt(smallScene(kLamp + kCheckered + kBox), 128, 16);
}

TEST_CASE("unbiased: bidirectional gradients with a wrong density of either subpath are detected",
          "[slow][gradients]") {
  const Stage stage(smallScene(kLamp + kWalls + kBox));
  const Estimates path = ofPixels(stage.camera, stage.path(), 64);
  const auto with = [&](float camera, float light) {
    return ofGradients(stage.camera, WrongBdptGradients(stage, camera, light), 16);
  };
  CHECK(agree(path, with(1, 1)));
  CHECK_FALSE(agree(path, with(1.2f, 1)));
  CHECK_FALSE(agree(path, with(1, 1.2f)));
}

TEST_CASE("unbiased: bidirectional gradients of glossy metal and the caustic of a glass ball", "[slow][gradients]") {
  checkBdpt(smallScene(kCheckered + R"(<shape type="sphere"><point name="center" x="1.5" y="-0.5" z="3.5"/>
      <float name="radius" value="0.4"/><emitter type="area"><rgb name="radiance" value="40, 40, 30"/></emitter></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="2"/><rotate x="1" angle="90"/><rotate z="1" angle="70"/>
      <translate x="-2.2" z="1"/></transform><bsdf type="twosided"><bsdf type="roughconductor">
        <string name="distribution" value="ggx"/><float name="alpha" value="0.3"/></bsdf></bsdf></shape>
    <shape type="sphere"><point name="center" x="1" y="0" z="0.9"/><float name="radius" value="0.7"/>
      <bsdf type="dielectric"/></shape>
    <shape type="sphere"><point name="center" x="-1" y="0" z="1"/>
      <bsdf type="roughconductor"><float name="alpha" value="0.01"/></bsdf></shape>
    <shape type="sphere"><point name="center" x="0" y="-1.2" z="0.5"/><float name="radius" value="0.5"/>
      <bsdf type="plastic"><rgb name="diffuse_reflectance" value="0.2, 0.3, 0.7"/></bsdf></shape>)"),
            256, 16);
}

TEST_CASE("unbiased: bidirectional gradients under an environment, a point and a distant light", "[slow][gradients]") {
  checkBdpt(smallScene(kCheckered + R"(<emitter type="constant"><rgb name="radiance" value="0.4, 0.5, 0.6"/></emitter>
    <emitter type="directional"><vector name="direction" x="1" y="1" z="-2"/><rgb name="irradiance" value="1, 1, 1"/></emitter>
    <emitter type="point"><point name="position" x="1" y="-1" z="2.5"/><rgb name="intensity" value="6, 5, 4"/></emitter>
    <shape type="sphere"><point name="center" x="-1.1" y="0" z="1"/>
      <bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf></shape>
    <shape type="sphere"><point name="center" x="0.2" y="-1.5" z="0.5"/><float name="radius" value="0.5"/>
      <bsdf type="roughplastic"><float name="alpha" value="0.2"/></bsdf></shape>
    <shape type="sphere"><point name="center" x="1.1" y="0" z="1"/>
      <bsdf type="roughdielectric"><string name="distribution" value="ggx"/><float name="alpha" value="0.3"/></bsdf></shape>)",
                       "tent"),
            128, 16);
}

TEST_CASE("unbiased: bidirectional gradients of coated, masked and mapped surfaces", "[slow][gradients]") {
  checkBdpt(smallScene(kLamp + R"(<shape type="rectangle"><transform name="to_world"><scale value="4"/></transform>
      <bsdf type="normalmap"><texture type="checkerboard">
          <rgb name="color0" value="0.8, 0.5, 0.9"/><rgb name="color1" value="0.3, 0.9, 0.8"/></texture>
        <bsdf type="roughcoating"><float name="alpha" value="0.2"/>
          <bsdf type="roughconductor"><float name="alpha" value="0.3"/></bsdf></bsdf></bsdf></shape>
    <shape type="sphere"><point name="center" x="-1.2" y="0" z="1"/>
      <bsdf type="coating"><rgb name="sigma_a" value="0.1, 0.3, 0.6"/>
        <bsdf type="roughplastic"><float name="alpha" value="0.2"/></bsdf></bsdf></shape>
    <shape type="sphere"><point name="center" x="0.2" y="-1.5" z="0.5"/><float name="radius" value="0.5"/>
      <bsdf type="mask"><float name="opacity" value="0.6"/><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></bsdf></shape>
    <shape type="sphere"><point name="center" x="0" y="0.8" z="0.8"/><float name="radius" value="0.8"/>
      <bsdf type="conductor"/></shape>
    <shape type="rectangle">
      <transform name="to_world"><rotate x="1" angle="80"/><translate x="1.4" z="1"/></transform>
      <bsdf type="principledthin"><float name="roughness" value="0.3"/><float name="spec_trans" value="0.5"/>
        <float name="diff_trans" value="0.8"/></bsdf></shape>)"),
            128, 16);
}

TEST_CASE("unbiased: bidirectional gradients with guided paths", "[slow][gradients]") {
  const Studio studio(smallScene(kLamp + kCheckered + kBox), 30, 20);
  const Estimates path = ofPixels(studio.camera(), studio.path(), 64);
  for (const GuidedSampler* guide : {&studio.productSampler(), &studio.guidedSampler()})
    CHECK(agree(path, ofGradients(studio.camera(),
                                  GuidedBdptGradients(studio.renderScene(), studio.camera(), {}, *guide,
                                                      studio.importanceSampler()),
                                  8)));
}

TEST_CASE("unbiased: bidirectional gradients do not depend on the number of threads", "[gradients]") {
  const Stage stage(smallScene(kLamp + kWalls + kBox, "gaussian"));
  const auto renderWith = [&](std::size_t threads) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    GradientFilm film(30, 20);
    render(stage.camera, BdptGradients(stage.ready, stage.camera, stage.options), film, {1, 4, std::nullopt});
    return film.reconstruct(ReconstructionNorm::l1).image;
  };
  const Image one = renderWith(1), two = renderWith(2), seven = renderWith(7);
  for (std::size_t i = 0; i < one.pixels.size(); ++i) {
    REQUIRE((one.pixels[i] == two.pixels[i]).all());
    REQUIRE((one.pixels[i] == seven.pixels[i]).all());
  }
}
