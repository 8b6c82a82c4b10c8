// Gradient-domain path tracing: the parts of the shift against finite differences and closed forms, the reconstruction
// against a dense solver, and paths in closed forms.

#include <algorithm>
#include <limits>
#include <string>

#include <fmt/format.h>
#include <oneapi/tbb/global_control.h>
#include <Eigen/Dense>
#include <catch2/catch.hpp>

#include "runtime/render/gradients/gradient_integrator.h"
#include "runtime/render/gradients/half_vector.h"
#include "runtime/render/gradients/offset_path.h"
#include "tests/support/render_test_tools.h"
#include "tests/support/scenes_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

Vec3 randomDirection(Rng& rng, bool above) {
  const Vec3 w = squareToSphere(rng.uniform2());
  return above == (w.z() > 0) ? w : Vec3(w.x(), w.y(), -w.z());
}

/// |∂f/∂w| over solid angle, for a function from directions to directions.
template <class Function>
double jacobianOf(const Function& f, const Vec3& w, float step = 2e-3f) {
  const Frame in = Frame::fromNormal(w);
  const auto at = [&](float a, float b) -> Vec3 { return f((w + a * in.s + b * in.t).normalized()); };
  const Vec3 ds = (at(step, 0) - at(-step, 0)) / (2 * step), dt = (at(0, step) - at(0, -step)) / (2 * step);
  return ds.cross(dt).norm();
}

/// Checks the copy of half vectors for random directions with wi on the given side. Returns the number of checks.
int checkHalfVectors(bool reflects, float eta) {
  Rng rng(3);
  int checked = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3 wo = randomDirection(rng, true), wi = randomDirection(rng, reflects);
    const Vec3 other = (wo + 0.3f * randomDirection(rng, true)).normalized();
    if (std::min({std::abs(wo.z()), std::abs(wi.z()), other.z()}) < 0.1f) continue;
    const auto shifted = copyHalfVector(wo, wi, eta, other);
    if (!shifted || std::abs(shifted->wi.z()) < 0.1f || shifted->jacobian > 4 || shifted->jacobian < 0.25f) continue;
    const auto back = copyHalfVector(other, shifted->wi, eta, wo);
    REQUIRE(back);
    CHECK((back->wi - wi).norm() < 1e-4);
    CHECK(back->jacobian * shifted->jacobian == Approx(1).epsilon(1e-3));
    bool everywhere = true;  // not at the limit of total internal reflection
    const auto shift = [&](const Vec3& w) -> Vec3 {
      const auto near = copyHalfVector(wo, w, eta, other);
      everywhere = everywhere && near;
      return near ? near->wi : wi;
    };
    const double jacobian = jacobianOf(shift, wi);
    if (!everywhere) continue;
    CHECK(jacobian == Approx(shifted->jacobian).epsilon(0.03));
    ++checked;
  }
  return checked;
}

Image randomImage(int width, int height, Rng& rng) {
  Image image(width, height);
  for (Rgb& pixel : image.pixels) pixel = Rgb(rng.uniform(), rng.uniform(), rng.uniform());
  return image;
}

/// The least-squares problem, one row for each term.
Eigen::VectorXd denseSolution(const Image& pixels, const Image& dx, const Image& dy, int channel) {
  const int n = static_cast<int>(pixels.pixels.size()), w = pixels.width;
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(3 * n, n);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(3 * n);
  for (int i = 0; i < n; ++i) {
    a(i, i) = kScreening, b(i) = kScreening * pixels.pixels[i][channel];
    if (i % w + 1 < w) a(n + i, i) = -1, a(n + i, i + 1) = 1, b(n + i) = dx.pixels[i][channel];
    if (i + w < n) a(2 * n + i, i) = -1, a(2 * n + i, i + w) = 1, b(2 * n + i) = dy.pixels[i][channel];
  }
  return a.colPivHouseholderQr().solve(b);
}

}  // namespace

TEST_CASE("gradients: densities whose squares overflow give finite differences") {
  const float infinite = std::numeric_limits<float>::infinity();
  const Contribution base(Rgb::Constant(2), 1, 2);
  for (const bool sameShift : {true, false}) {
    CHECK((weightedDifference(base, Contribution(Rgb::Constant(1e30f), infinite, infinite), sameShift) == 0).all());
    CHECK((weightedDifference(Contribution(Rgb::Constant(2), 1, infinite), base, sameShift) == 0).all());
  }
}

TEST_CASE("gradients: a copied half vector has the Jacobian of finite differences and is its own inverse") {
  CHECK(checkHalfVectors(true, 1) > 300);
  CHECK(checkHalfVectors(false, 1.5f) > 200);
  CHECK(checkHalfVectors(false, 1 / 1.5f) > 50);
  CHECK(checkHalfVectors(false, 1) > 300);
}

TEST_CASE("gradients: a copied half vector keeps mirrors and refracting interfaces") {
  const Vec3 wo = Vec3(0.3f, 0.2f, 0.8f).normalized(), other = Vec3(-0.2f, 0.5f, 0.7f).normalized();
  const auto mirrored = copyHalfVector(wo, {-wo.x(), -wo.y(), wo.z()}, 1, other);
  REQUIRE(mirrored);
  CHECK((mirrored->wi - Vec3(-other.x(), -other.y(), other.z())).norm() < 1e-6);
  const float eta = 1.5f;
  const auto refracted = [&](const Vec3& w) {
    return Vec3(-w.x() / eta, -w.y() / eta, -std::sqrt(1 - w.head<2>().squaredNorm() / (eta * eta)));
  };
  const auto through = copyHalfVector(wo, refracted(wo), eta, other);
  REQUIRE(through);
  CHECK((through->wi - refracted(other)).norm() < 1e-6);
  // From inside, beyond the critical angle.
  CHECK_FALSE(copyHalfVector(Vec3(0, 0, 1), Vec3(0, 0, -1), 1 / eta, Vec3(0.8f, 0, 0.6f)));
  CHECK_FALSE(copyHalfVector(wo, {-wo.x(), -wo.y(), wo.z()}, 1, -other));
}

TEST_CASE("gradients: a connection has the Jacobian of finite differences") {
  const Vec3 normal = Vec3(0.2f, -0.1f, 1).normalized(), base(1, 2, -3), offset(0.5f, -1, -2);
  // The surface is the plane through the origin: the point that the base vertex at −base sees in a direction.
  const auto seen = [&](const Vec3& w) -> Vec3 { return w * (normal.dot(base) / normal.dot(w)) - base; };
  const auto shift = [&](const Vec3& w) -> Vec3 { return (seen(w) + offset).normalized(); };
  CHECK(jacobianOf(shift, base.normalized()) == Approx(connectionJacobian(normal, base, offset)).epsilon(0.01));
}

TEST_CASE("gradients: delta components are found wherever they have a sample, also beside metal seen from behind") {
  const std::string glass = R"(<bsdf type="dielectric"/>)", metal = R"(<bsdf type="conductor"/>)";
  const std::string parts = GENERATE_COPY(glass + metal, metal + glass);
  const float weight = GENERATE(0.02f, 0.2f, 0.5f, 0.8f, 0.98f);
  const float side = GENERATE(1.0f, -1.0f);
  CAPTURE(parts, weight, side);
  const Scene scene =
      readBody(fmt::format(R"(<shape type="rectangle"><bsdf type="blendbsdf"><float name="weight" value="{}"/>{}</bsdf>
        </shape>)",
                           weight, parts));
  const RenderScene ready(scene);
  const std::optional<SurfaceHit> hit =
      ready.tracer.trace({Vec3(0.1f, 0.2f, side), Vec3(0.2f, 0.1f, -side).normalized()});
  REQUIRE(hit);
  REQUIRE(hit->wo.z() * side > 0);
  constexpr int kChoices = 1000;
  int samples = 0;
  for (int i = 0; i < kChoices; ++i) {
    const std::optional<DeltaSample> sample = sampleDelta(*hit, (static_cast<float>(i) + 0.5f) / kChoices);
    if (!sample) continue;
    ++samples;
    const std::optional<DeltaSample> found = deltaComponent(*hit, sample->component);
    REQUIRE(found);
    CHECK((found->wi == sample->wi));
    CHECK(found->probability == sample->probability);
  }
  CHECK(samples > 0);
  CHECK((samples < kChoices) == (side < 0));
}

TEST_CASE("gradients: the reconstruction is the solution of a dense least-squares solver") {
  Rng rng(1);
  const Image pixels = randomImage(7, 5, rng), dx = randomImage(7, 5, rng), dy = randomImage(7, 5, rng);
  const Image image = reconstruct(pixels, dx, dy, ReconstructionNorm::l2);
  for (int c = 0; c < 3; ++c) {
    const Eigen::VectorXd expected = denseSolution(pixels, dx, dy, c);
    for (int i = 0; i < expected.size(); ++i) CHECK(image.pixels[i][c] == Approx(expected[i]).margin(1e-5));
  }
}

TEST_CASE("gradients: L1 ignores an outlier, and both norms reproduce consistent input") {
  const int width = 24, height = 20;
  Image pixels(width, height), dx(width, height), dy(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      pixels.at(x, y) = Rgb(1.0f + 0.1f * x, 2.0f - 0.05f * y, 1.5f);
      dx.at(x, y) = Rgb(0.1f, 0, 0), dy.at(x, y) = Rgb(0, -0.05f, 0);
    }
  const auto error = [&](ReconstructionNorm norm) {
    const Image image = reconstruct(pixels, dx, dy, norm);
    float worst = 0;
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
      const std::size_t column = i % width, row = i / width;
      const Rgb expected(1.0f + 0.1f * static_cast<float>(column), 2.0f - 0.05f * static_cast<float>(row), 1.5f);
      worst = std::max(worst, (image.pixels[i] - expected).abs().maxCoeff());
    }
    return worst;
  };
  CHECK(error(ReconstructionNorm::l2) < 1e-4);
  CHECK(error(ReconstructionNorm::l1) < 1e-4);
  dx.at(11, 9) = grey(5);
  CHECK(error(ReconstructionNorm::l2) > 0.5);
  CHECK(error(ReconstructionNorm::l1) < 0.01);
}

namespace {

GradientFilm renderGradients(const Scene& scene, int size, int samples, std::uint64_t seed) {
  const RenderScene ready(scene);
  Camera lens = scene.camera;
  lens.width = lens.height = size;
  const RayCamera camera(lens, scene.filter);
  GradientFilm film(size, size);
  render(camera, PathGradients(ready, camera, {}), film, {seed, samples, std::nullopt});
  return film;
}

/// Seen from inside.
Scene boxScene(const BsdfPtr& bsdf, float emission) {
  Scene scene;
  addEmitter(scene, box({-1, -1, -1}, {1, 1, 1}, true), emission, addMaterial(scene, bsdf));
  return scene;
}

}  // namespace

TEST_CASE("gradients: in a furnace, the reconstruction is emission over one minus albedo") {
  BsdfPtr bsdf = std::make_shared<Diffuse>(0.6f);
  SECTION("diffuse") {}
  SECTION("half mirror") {
    bsdf = std::make_shared<HalfMirror>(0.4f, 0.2f, 0.3f);
  }
  const Scene scene = boxScene(bsdf, 0.5f);
  Moments mean, dx, dy;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const GradientFilm film = renderGradients(scene, 8, 16, seed);
    const ReconstructedImage result = film.reconstruct(ReconstructionNorm::l2);
    CHECK(result.clampedFraction == 0);
    mean.add(result.image.at(3, 4).y());
    dx.add(film.dx().at(3, 4).y());
    dy.add(film.dy().at(4, 3).y());
  }
  CHECK(deviation(mean, 1.25) < kMaxDeviation);
  CHECK(std::abs(dx.mean()) < kMaxDeviation * dx.error());
  CHECK(std::abs(dy.mean()) < kMaxDeviation * dy.error());
}

TEST_CASE("gradients: directly visible light has exact differences") {
  // Absorbing walls: every sample of a pixel sees the emission itself.
  const GradientFilm film = renderGradients(boxScene(nullptr, 0.5f), 8, 4, 1);
  for (const Rgb& difference : film.dx().pixels) CHECK((difference == 0.0f).all());
  for (const Rgb& pixel : film.reconstruct(ReconstructionNorm::l2).image.pixels)
    CHECK(pixel.y() == Approx(0.5).epsilon(1e-6));
}

TEST_CASE("gradients: with a maximum depth of 0, the picture is black") {
  const Scene scene = boxScene(std::make_shared<Diffuse>(0.6f), 0.5f);
  const RenderScene ready(scene);
  Camera lens = scene.camera;
  lens.width = lens.height = 8;
  const RayCamera camera(lens, scene.filter);
  PathOptions options;
  options.maxDepth = 0;
  const auto isBlack = [&](const auto& integrator) {
    GradientFilm film(8, 8);
    render(camera, integrator, film, {1, 4, std::nullopt});
    return std::ranges::all_of(film.reconstruct(ReconstructionNorm::l2).image.pixels,
                               [](const Rgb& pixel) { return (pixel == 0.0f).all(); });
  };
  CHECK(isBlack(PathGradients(ready, camera, options)));
  CHECK(isBlack(BdptGradients(ready, camera, options)));
}

TEST_CASE("gradients: visible emission does not spread to the pixels around it") {
  GradientFilm film(9, 9);
  for (int y = 0; y < 9; ++y)
    for (int x = 0; x < 9; ++x) {
      GradientSample sample;
      sample.radiance = grey(1);
      if (x == 4 && y == 4) sample.visible = grey(1000);
      film.add(x, y, sample);
    }
  const Image image = film.reconstruct(ReconstructionNorm::l2).image;
  for (int y = 0; y < 9; ++y)
    for (int x = 0; x < 9; ++x) CHECK(image.at(x, y).x() == Approx(x == 4 && y == 4 ? 1001 : 1).epsilon(1e-4));
  CHECK(film.pixels().mean().at(4, 4).x() == Approx(1001));
}

TEST_CASE("gradients: the same bytes on any number of threads") {
  const Scene scene = boxScene(std::make_shared<HalfMirror>(0.4f, 0.2f, 0.3f), 0.5f);
  const auto renderWith = [&](std::size_t threads, ReconstructionNorm norm) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    return renderGradients(scene, 40, 4, 1).reconstruct(norm).image;
  };
  for (const ReconstructionNorm norm : {ReconstructionNorm::l2, ReconstructionNorm::l1}) {
    const Image one = renderWith(1, norm), two = renderWith(2, norm), seven = renderWith(7, norm);
    for (std::size_t i = 0; i < one.pixels.size(); ++i) {
      REQUIRE((one.pixels[i] == two.pixels[i]).all());
      REQUIRE((one.pixels[i] == seven.pixels[i]).all());
    }
  }
}
