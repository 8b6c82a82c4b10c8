// Bitmaps and checkerboards.

#include <limits>
#include <memory>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "materials/textures/bitmap.h"
#include "materials/textures/checkerboard.h"
#include "runtime/image/image.h"
#include "tests/support/meshes_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

/// 4×2, each pixel (x, y, 0).
std::shared_ptr<const Image> ramp() {
  auto image = std::make_shared<Image>(4, 2);
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 4; ++x) image->at(x, y) = Rgb(x, y, 0);
  return image;
}

Vec2 centre(int x, int y) {
  return {(x + 0.5f) / 4, (y + 0.5f) / 2};
}

}  // namespace

TEST_CASE("materials: a bitmap has its pixel values at their centres and its first row at v = 0") {
  for (const bool nearest : {false, true}) {
    BitmapOptions options;
    options.nearest = nearest;
    const TexturePtr texture = makeBitmap(ramp(), options);
    for (int y = 0; y < 2; ++y)
      for (int x = 0; x < 4; ++x) requireNear(texture->eval(centre(x, y)), Rgb(x, y, 0));
    requireNear(texture->mean(), Rgb(1.5f, 0.5f, 0));
    requireNear(texture->eval({0.5f, 0.25f}), nearest ? Rgb(2, 0, 0) : Rgb(1.5f, 0, 0));
    requireNear(texture->eval({0.375f, 0.4f}), nearest ? Rgb(1, 0, 0) : Rgb(1, 0.3f, 0));
  }
}

TEST_CASE("materials: bitmaps repeat or mirror or clamp for each axis separately") {
  const auto at = [](Wrap u, Wrap v, int x, int y) {
    BitmapOptions options;
    options.wrapU = u;
    options.wrapV = v;
    return makeBitmap(ramp(), options)->eval(centre(x, y));
  };
  requireNear(at(Wrap::repeat, Wrap::repeat, -1, 2), Rgb(3, 0, 0));
  requireNear(at(Wrap::repeat, Wrap::repeat, 403, -3), Rgb(3, 1, 0), 1e-3f);
  requireNear(at(Wrap::mirror, Wrap::mirror, -1, 2), Rgb(0, 1, 0));
  requireNear(at(Wrap::mirror, Wrap::mirror, 5, 4), Rgb(2, 0, 0));
  requireNear(at(Wrap::mirror, Wrap::mirror, 8, -4), Rgb(0, 0, 0));
  requireNear(at(Wrap::clamp, Wrap::clamp, -9, 9), Rgb(0, 1, 0));
  requireNear(at(Wrap::clamp, Wrap::clamp, 9, -9), Rgb(3, 0, 0));
  requireNear(at(Wrap::clamp, Wrap::repeat, 9, -1), Rgb(3, 1, 0));
  requireNear(at(Wrap::zero, Wrap::one, -1, 0), grey(0));
  requireNear(at(Wrap::zero, Wrap::one, 2, 2), grey(1));
  requireNear(at(Wrap::zero, Wrap::one, 2, 1), Rgb(2, 1, 0));
  // Interpolation crosses the seam only if the image repeats.
  requireNear(makeBitmap(ramp())->eval({0, 0.25f}), Rgb(1.5f, 0, 0));
  BitmapOptions clamped;
  clamped.wrapU = Wrap::clamp;
  requireNear(makeBitmap(ramp(), clamped)->eval({0, 0.25f}), Rgb(0, 0, 0));
}

TEST_CASE("materials: the coordinates of a bitmap are scaled and then shifted") {
  BitmapOptions options;
  options.uvMap.linear = Vec2(2, -1).asDiagonal();
  options.uvMap.offset = {0.25f, 1};
  const TexturePtr texture = makeBitmap(ramp(), options);
  requireNear(texture->eval({0.0625f, 0.25f}), Rgb(1, 1, 0));
  requireNear(texture->eval({0.1875f, 0.75f}), Rgb(2, 0, 0));
  options.uvMap.linear << 0, 1, 1, 0;
  options.uvMap.offset = {0, 0};
  requireNear(makeBitmap(ramp(), options)->eval({0.25f, 0.875f}), Rgb(3, 0, 0));
}

TEST_CASE("materials: bitmaps accept extreme coordinates and reject empty images") {
  const TexturePtr texture = makeBitmap(ramp());
  for (const float extreme :
       {1e30f, -std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
    REQUIRE(texture->eval({extreme, 0.5f}).allFinite());
    REQUIRE(texture->eval({0.5f, extreme}).allFinite());
  }
  REQUIRE_THROWS_AS(makeBitmap(std::make_shared<Image>()), std::runtime_error);
  REQUIRE_THROWS_AS(makeBitmap(nullptr), std::runtime_error);
}

TEST_CASE("materials: a checkerboard alternates its colours") {
  const TexturePtr a = constantTexture(Rgb(1, 0, 0)), b = makeBitmap(ramp());
  const TexturePtr board = makeCheckerboard(a, b);
  requireNear(board->eval({0.2f, 0.3f}), Rgb(1, 0, 0));
  requireNear(board->eval({0.7f, 0.8f}), Rgb(1, 0, 0));
  requireNear(board->eval({-0.3f, 5.8f}), Rgb(1, 0, 0));
  requireNear(board->eval(centre(2, 0)), Rgb(2, 0, 0));
  requireNear(board->mean(), Rgb(1.25f, 0.25f, 0));
  const TexturePtr fine = makeCheckerboard(a, b, {2 * Eigen::Matrix2f::Identity(), {0.5f, 0}});
  requireNear(fine->eval({0.05f, 0.3f}), Rgb(1, 0, 0));
  requireNear(fine->eval({0.35f, 0.3f}), b->eval({0.35f, 0.3f}));
}
