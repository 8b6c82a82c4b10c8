// Vertex connection and merging: closed forms, path tracing, independence of threads, and the search of photons.

#include <algorithm>
#include <cstring>
#include <vector>

#include <oneapi/tbb/global_control.h>
#include <catch2/catch.hpp>

#include "tests/support/bidirectional_test_tools.h"
#include "tests/support/render_test_tools.h"

using namespace lobe;
using namespace lobe::test;

TEST_CASE("vcm: the radiance in a furnace is emission over one minus albedo", "[slow]") {
  // On a large sphere merging has no noticeable bias.
  const float emission = 0.5f, albedo = 0.6f;
  Scene scene = sceneWith("");
  scene.camera.toWorld.setIdentity();
  scene.camera.width = 60, scene.camera.height = 45;  // enough light paths for merging to have most of the weight
  const bool mirror = GENERATE(false, true);
  const BsdfPtr wall =
      mirror ? BsdfPtr(std::make_shared<HalfMirror>(0.4f, 0.2f, 0.3f)) : std::make_shared<Diffuse>(albedo);
  addEmitter(scene, Sphere{{0, 0, 1}, 2.0f, true}, emission, addMaterial(scene, wall));
  const Stage stage(std::move(scene));
  const float radius = GENERATE(0.02f, 0.1f);
  const auto found = renderBlocks(stage, stage.vcm(radius), {48, 3, 1});
  CHECK(agree(found, std::vector<Block>(found.size(), Block{emission / (1 - albedo), 0})));
}

TEST_CASE("vcm: a small radius gives the image of path tracing, nearly") {
  // Lights whose light paths matter, and a mirror in which merging finds a caustic.
  const Stage stage(sceneWith(std::string(kFloor) + kLamp + R"(<shape type="sphere">
    <point name="center" x="0.8" y="-0.3" z="1"/><float name="radius" value="0.9"/><bsdf type="dielectric"/></shape>)"));
  const auto path = renderBlocks(stage, stage.path(), {48, 48, 1});
  const auto vcm = renderBlocks(stage, stage.vcm(0.02f), {48, 12, 1000});
  double sumOfPath = 0, sum = 0;
  for (std::size_t i = 0; i < path.size(); ++i) sumOfPath += path[i].mean, sum += vcm[i].mean;
  CHECK(sum == Approx(sumOfPath).epsilon(0.02));
}

TEST_CASE("vcm: the image does not depend on threads, and the radius shrinks") {
  const Stage stage(sceneWith(std::string(kFloor) + kLamp));
  const auto image = [&](int threads) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    Film film(stage.camera.width(), stage.camera.height());
    RenderOptions options;
    options.samples = 4;
    VcmIntegrator vcm = stage.vcm(0.1f);
    render(stage.camera, vcm, film, options);
    return film.mean();
  };
  const Image one = image(1), two = image(2), seven = image(7);
  CHECK(std::memcmp(one.pixels.data(), two.pixels.data(), one.pixels.size() * sizeof(Rgb)) == 0);
  CHECK(std::memcmp(one.pixels.data(), seven.pixels.data(), one.pixels.size() * sizeof(Rgb)) == 0);
  const MergeRadius radius{2, 0.5f};
  CHECK(radius.at(0) == 2);
  CHECK(radius.at(15) == Approx(1));
}

TEST_CASE("vcm: all photons within the radius are found, once") {
  Rng rng(3);
  std::vector<Photon> photons;
  const PartialWeights none = PartialWeights::fromCamera(1, 1, 0);
  for (int i = 0; i < 2000; ++i) {
    const float x = rng.uniform(), y = rng.uniform();
    photons.push_back(
        {Vec3(x, y, rng.uniform()) - Vec3::Constant(0.5f), Vec3::UnitZ(), Vec3::UnitZ(), grey(1), none, i, false});
  }
  const float radius = 0.08f;
  const PhotonGrid grid(photons, radius);
  for (int q = 0; q < 200; ++q) {
    const Vec3 centre = photons[static_cast<std::size_t>(q)].position + Vec3::Constant(0.03f);
    std::vector<int> found, expected;
    grid.forEachNear(centre, [&](const Photon& photon) { found.push_back(photon.depth); });
    for (const Photon& photon : photons)
      if ((photon.position - centre).norm() <= radius) expected.push_back(photon.depth);
    std::ranges::sort(found);
    CHECK(found == expected);
  }
}
