// Ray tracing, surface hits and cameras.

#include "runtime/render/film/camera.h"
#include "tests/support/chi2.h"
#include "tests/support/render_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

Vec3 randomDirection(Sampler& rng) {
  return squareToSphere(rng.uniform2());
}

// A random direction in the hemisphere around `side`.
Vec3 randomDirection(Sampler& rng, const Vec3& side) {
  const Vec3 d = randomDirection(rng);
  return d.dot(side) < 0 ? Vec3(-d) : d;
}

SurfaceHit hitOf(const Scene& scene, const Ray& ray) {
  const RayTracer tracer(scene);
  const auto hit = tracer.trace(ray);
  REQUIRE(hit);
  return *hit;
}

// Rays from points on a closed convex shape must hit nothing outwards and the far wall inwards.
struct Leaks {
  int self = 0, through = 0;
};
Leaks leaksOf(const Scene& scene, const Vec3& centre, float size) {
  const RayTracer tracer(scene);
  Leaks leaks;
  Sampler rng(3);
  for (int i = 0; i < 20000; ++i) {
    const Vec3 from = centre + 3 * size * randomDirection(rng);
    const Vec3 to = centre + 0.4f * size * randomDirection(rng);
    const auto hit = tracer.trace({from, (to - from).normalized()});
    if (!hit) {
      ++leaks.through;
      continue;
    }
    const Ray out = spawnRay(*hit, randomDirection(rng, hit->normal));
    leaks.self += tracer.occluded(out);
    const Ray in = spawnRay(*hit, randomDirection(rng, -hit->normal));
    const auto far = tracer.trace(in);
    leaks.through += !far || far->normal.dot(in.direction) < 0;
  }
  return leaks;
}

}  // namespace

TEST_CASE("render: rays leave surfaces without self-intersection at any scale") {
  const float size = GENERATE(1e-4f, 1e-2f, 1.0f, 1e4f);
  const float away = GENERATE(0.0f, 30.0f);  // distance from the origin in units of size
  const Vec3 centre = size * away * Vec3(0.3f, -0.8f, 0.52f);
  CAPTURE(size, away);
  Scene scene;
  const auto check = [&](const Geometry& geometry) {
    addShape(scene, geometry, -1);
    const Leaks leaks = leaksOf(scene, centre, size);
    CHECK(leaks.self == 0);
    CHECK(leaks.through == 0);
  };
  SECTION("sphere") {
    check(Sphere{centre, size});
  }
  SECTION("box") {
    check(box(centre - Vec3::Constant(size), centre + Vec3::Constant(size), false));
  }
  SECTION("mesh") {
    check(sphereMesh(centre, size, 12));
  }
  SECTION("cylinder with lids") {
    addShape(scene, Disk{centre + Vec3(0, 0, size), {size, 0, 0}, {0, size, 0}}, -1);
    addShape(scene, Disk{centre - Vec3(0, 0, size), {0, size, 0}, {size, 0, 0}}, -1);
    check(Cylinder{centre - Vec3(0, 0, size), {size, 0, 0}, {0, size, 0}, {0, 0, 2 * size}});
  }
  SECTION("instance of a mesh far from its own origin") {
    scene.groups.resize(1);
    scene.groups[0].shapes.push_back({"", sphereMesh({3, 5, -2}, 0.01f, 12), -1, std::nullopt});
    Eigen::Affine3f toWorld(Eigen::Translation3f(centre) * Eigen::AngleAxisf(0.8f, Vec3(2, 1, 2) / 3) *
                            Eigen::Scaling(100 * size) * Eigen::Translation3f(-3, -5, 2));
    check(Instance{0, toWorld});
  }
}

TEST_CASE("render: ray offsets are small compared with the scene") {
  Scene scene;
  addShape(scene, sphereMesh({0, 0, 0}, 1.0f, 12), -1);
  const SurfaceHit hit = hitOf(scene, {Vec3(3, 2, 1), -Vec3(3, 2, 1).normalized()});
  CHECK(hit.offset > 0);
  CHECK(hit.offset < 2e-5f);
}

TEST_CASE("render: light does not leak through a floor from just below it") {
  Scene scene;
  addShape(scene, rectangle({-5, 0, -5}, {0, 0, 10}, {10, 0, 0}), -1);
  addEmitter(scene, rectangle({-1, -0.01f, -1}, {0, 0, 2}, {2, 0, 0}), 1);  // just below the floor, shining up
  const RenderScene ready(scene);
  const SurfaceHit floor = hitOf(scene, {Vec3(0.3f, 1, 0.2f), Vec3(0, -1, 0)});
  Sampler rng(1);
  for (int i = 0; i < 1000; ++i) {
    const double choice = rng.uniformDouble();
    const auto light =
        ready.lights.at(LightReceiver{Vec3(0.3f, 0.5f, 0.2f), Vec3::Zero()}).sample(choice, rng.uniform2());
    REQUIRE(light);
    SurfacePoint above = floor;
    above.position.y() += 0.5f;
    CHECK_FALSE(ready.visible(above, *light));
  }
}

TEST_CASE("render: a hit has the correct position and normal and uv and frame") {
  Scene scene;
  const int material = addMaterial(scene, std::make_shared<Diffuse>(0.5f));
  SECTION("triangle") {
    addShape(scene, rectangle({0, 0, 0}, {0, 0, 4}, {2, 0, 0}), material);
    const SurfaceHit hit = hitOf(scene, {Vec3(0.5f, 2, 3), Vec3(0, -1, 0)});
    CHECK((hit.position - Vec3(0.5f, 0, 3)).norm() < 1e-6f);
    CHECK((hit.normal - Vec3(0, 1, 0)).norm() < 1e-6f);
    CHECK((hit.uv - Vec2(0.75f, 0.25f)).norm() < 1e-6f);
    CHECK((hit.frame.s - Vec3(0, 0, 1)).norm() < 1e-6f);  // along u
    CHECK(hit.wo.z() == Approx(1));
    CHECK(hit.distance == Approx(2));
    CHECK(hit.bsdf == scene.materials[0].bsdf.get());
    const SurfaceHit behind = hitOf(scene, {Vec3(0.5f, -2, 3), Vec3(0, 1, 0)});
    CHECK((behind.normal - Vec3(0, 1, 0)).norm() < 1e-6f);
    CHECK(behind.wo.z() == Approx(-1));
  }
  SECTION("triangle with normals that point to the other side") {
    TriangleMesh mesh = rectangle({0, 0, 0}, {0, 0, 4}, {2, 0, 0});
    mesh.normals.assign(4, Vec3(0.6f, -0.8f, 0));
    addShape(scene, mesh, material);
    const SurfaceHit hit = hitOf(scene, {Vec3(0.5f, 2, 3), Vec3(0, -1, 0)});
    CHECK((hit.frame.n - Vec3(-0.6f, 0.8f, 0)).norm() < 1e-6f);
    const Vec3 grazing = Vec3(1, 0.1f, 0).normalized();  // above the surface, below the shading normal's horizon
    CHECK_FALSE(sidesAgree(hit, grazing, hit.frame.toLocal(grazing)));
    CHECK(sidesAgree(hit, Vec3(0, 1, 0), hit.frame.toLocal(Vec3(0, 1, 0))));
    CHECK(sidesAgree(hit, Vec3(0, -1, 0), hit.frame.toLocal(Vec3(0, -1, 0))));
  }
  SECTION("sphere, from outside and inside") {
    const bool flipped = GENERATE(false, true);
    addShape(scene, Sphere{{1, 2, 3}, 0.5f, flipped}, material);
    const float side = flipped ? -1.0f : 1.0f;
    for (const float start : {5.0f, 1.0f}) {
      const SurfaceHit hit = hitOf(scene, {Vec3(start, 2, 3), start > 1 ? Vec3(-1, 0, 0) : Vec3(1, 0, 0)});
      CHECK((hit.position - Vec3(1.5f, 2, 3)).norm() < 1e-6f);
      CHECK((hit.normal - Vec3(side, 0, 0)).norm() < 1e-6f);
      CHECK((hit.frame.s - Vec3(0, 1, 0)).norm() < 1e-5f);
      CHECK((hit.uv - Vec2(0, 0.5f)).norm() < 1e-6f);
    }
  }
  SECTION("disk") {
    addShape(scene, Disk{{0, 1, 0}, {0, 0, 2}, {2, 0, 0}}, material);
    const SurfaceHit hit = hitOf(scene, {Vec3(1, 3, 0), Vec3(0, -1, 0)});
    CHECK((hit.position - Vec3(1, 1, 0)).norm() < 1e-6f);
    CHECK((hit.normal - Vec3(0, 1, 0)).norm() < 1e-6f);
    CHECK((hit.uv - Vec2(0.5f, 0.25f)).norm() < 1e-6f);
    CHECK_FALSE(RayTracer(scene).trace({Vec3(1.5f, 3, 1.5f), Vec3(0, -1, 0)}));
  }
}

TEST_CASE("render: a cylinder is hit from outside and inside and is open at its ends") {
  Scene scene;
  const int material = addMaterial(scene, std::make_shared<Diffuse>(0.5f));
  const bool flipped = GENERATE(false, true);
  const float side = flipped ? -1.0f : 1.0f;
  addShape(scene, Cylinder{{1, 2, 3}, {0.5f, 0, 0}, {0, 0.5f, 0}, {0, 0, 4}, flipped}, material);
  for (const float start : {5.0f, 1.0f}) {
    const SurfaceHit hit = hitOf(scene, {Vec3(start, 2, 4), start > 1 ? Vec3(-1, 0, 0) : Vec3(1, 0, 0)});
    CHECK((hit.position - Vec3(1.5f, 2, 4)).norm() < 1e-6f);
    CHECK((hit.normal - Vec3(side, 0, 0)).norm() < 1e-6f);
    CHECK((hit.frame.s - Vec3(0, 1, 0)).norm() < 1e-5f);
    CHECK((hit.uv - Vec2(0, 0.25f)).norm() < 1e-6f);
  }
  const RayTracer tracer(scene);
  CHECK_FALSE(tracer.trace({Vec3(1.2f, 2, 0), Vec3(0, 0, 1)}));   // along the axis
  CHECK_FALSE(tracer.trace({Vec3(5, 2, 7.1f), Vec3(-1, 0, 0)}));  // past its end
  // Enters through the open end and hits the wall from inside.
  const SurfaceHit inside = hitOf(scene, {Vec3(1, 2, 2), Vec3(0.3f, 0, 1).normalized()});
  CHECK((inside.position - Vec3(1.5f, 2, 2 + 0.5f / 0.3f)).norm() < 1e-5f);
}

TEST_CASE("render: a sphere's uv coordinates rotate with its axes") {
  Scene scene;
  const Eigen::Matrix3f axes = Eigen::AngleAxisf(0.5f * kPi, Vec3::UnitX()).toRotationMatrix();
  addShape(scene, Sphere{{0, 0, 0}, 1, false, axes}, addMaterial(scene, std::make_shared<Diffuse>(0.5f)));
  // Its own z axis is the world's −y, its own y axis the world's z.
  CHECK(hitOf(scene, {Vec3(0, -3, 0), Vec3(0, 1, 0)}).uv.y() == Approx(0).margin(1e-6));
  const SurfaceHit hit = hitOf(scene, {Vec3(0, 0, 3), Vec3(0, 0, -1)});
  CHECK((hit.uv - Vec2(0.25f, 0.5f)).norm() < 1e-6f);
  CHECK((hit.frame.s - Vec3(-1, 0, 0)).norm() < 1e-5f);
}

namespace {

/// The mesh transformed to world space.
TriangleMesh baked(TriangleMesh mesh, const Eigen::Affine3f& toWorld) {
  for (Vec3& p : mesh.positions) p = toWorld * p;
  // Not normalised, so that interpolation weights them as in the group's space.
  for (Vec3& n : mesh.normals) n = toWorld.linear().inverse().transpose() * n;
  if (toWorld.linear().determinant() < 0)
    for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

}  // namespace

TEST_CASE("render: an instance is equivalent to the transformed mesh") {
  Eigen::Affine3f toWorld(Eigen::Translation3f(1, -2, 0.5f) * Eigen::AngleAxisf(0.8f, Vec3(2, 1, 2) / 3) *
                          Eigen::Scaling(2.0f, 0.5f, 1.0f));
  if (GENERATE(false, true)) toWorld = toWorld * Eigen::Scaling(-1.0f, 1.0f, 1.0f);
  const TriangleMesh ball = sphereMesh({0.1f, 0.2f, 0}, 0.6f, 7);
  const TriangleMesh plate = rectangle({-2, -2, -1}, {4, 0, 0.3f}, {0, 4, 0});
  Scene direct, instanced;
  for (Scene* scene : {&direct, &instanced})
    for (int i = 0; i < 2; ++i) addMaterial(*scene, std::make_shared<Diffuse>(0.5f));
  addShape(direct, baked(ball, toWorld), 0);
  addShape(direct, baked(plate, toWorld), 1);
  instanced.groups.resize(2);
  instanced.groups[1].shapes = {{"", ball, 0, std::nullopt}, {"", plate, 1, std::nullopt}};
  addShape(instanced, Instance{1, toWorld}, -1);
  const RayTracer a(direct), b(instanced);
  CHECK((a.bounds().diagonal() - b.bounds().diagonal()).norm() < 2.0f);  // instances use the bounding box of a box
  Sampler rng(8);
  int hits = 0, differing = 0;
  for (int i = 0; i < 5000; ++i) {
    const Vec3 from = 6 * randomDirection(rng);
    const Ray ray{from, (Vec3(1, -2, 0.5f) + randomDirection(rng) - from).normalized()};
    const auto x = a.trace(ray), y = b.trace(ray);
    if (!x || !y || x->material != y->material) {
      differing += x.has_value() != y.has_value();
      continue;
    }
    ++hits;
    const float error = (x->position - y->position).norm() + (x->normal - y->normal).norm() +
                        (x->frame.n - y->frame.n).norm() + (x->frame.s - y->frame.s).norm() +
                        std::abs(x->distance - y->distance) + (x->wo - y->wo).norm();
    differing += error > 1e-3f || (x->material == 1 && (x->uv - y->uv).norm() > 1e-4f);
    CHECK(y->shape == 0);
    CHECK(y->bsdf == instanced.materials[y->material].bsdf.get());
  }
  CHECK(hits > 3000);
  CHECK(differing < 20);  // rays that miss an edge due to rounding
}

TEST_CASE("render: rays that are not finite or beyond the range of Embree hit nothing") {
  Scene scene;
  addShape(scene, Sphere{{0, 0, 0}, 1}, -1);
  addShape(scene, sphereMesh({0, 0, 0}, 2, 7), -1);
  const RayTracer tracer(scene);
  const auto hits = [](const RayTracer& rays, const Ray& ray) { return rays.trace(ray) || rays.occluded(ray); };
  const Ray usual{{0.1f, 0.2f, 5}, {0, 0, -1}};
  CHECK(hits(tracer, usual));
  for (const float value : {std::numeric_limits<float>::quiet_NaN(), kInfinity, -kInfinity, 1e19f, -1e30f})
    for (int axis = 0; axis < 3; ++axis) {
      Ray from = usual, along = usual;
      from.origin[axis] = value;
      along.direction[axis] = value;
      CHECK(!hits(tracer, from));
      CHECK(!hits(tracer, along));
    }
  CHECK(!hits(tracer, {usual.origin, usual.direction, std::numeric_limits<float>::quiet_NaN()}));
  // In the group, the distance is 10^19.
  Scene flat;
  flat.groups.resize(1);
  flat.groups[0].shapes.push_back({"", sphereMesh({0, 0, 0}, 1, 7), -1, std::nullopt});
  addShape(flat, Instance{0, Eigen::Affine3f(Eigen::Scaling(1.0f, 1.0f, 1e-10f))}, -1);
  CHECK(hits(RayTracer(flat), usual));
  CHECK(!hits(RayTracer(flat), {{0.1f, 0.2f, 1e9f}, {0, 0, -1}}));
}

TEST_CASE("render: rays do not leak out of a spherical mesh") {
  Scene scene;
  addShape(scene, sphereMesh({0, 0, 0}, 1.0f, 40), -1);
  const RayTracer tracer(scene);
  Sampler rng(5);
  int missed = 0;
  for (int i = 0; i < 100000; ++i) missed += !tracer.occluded({Vec3(0.1f, 0.2f, 0.3f), randomDirection(rng)});
  CHECK(missed == 0);
  CHECK((tracer.bounds().max() - Vec3(1, 1, 1)).norm() < 0.01f);
}

namespace {

class Tilted : public Diffuse {
 public:
  Tilted() : Diffuse(0.5f) {}
  Vec3 perturbedNormal(const Vec3&, const Vec2&, const Vec3& dpdu, const Vec3&) const override {
    return Vec3(0.6f * dpdu.normalized() + 0.8f * Vec3::UnitZ());
  }
};

}  // namespace

TEST_CASE("render: the shading frame follows the perturbed normal") {
  Scene scene;
  addShape(scene, rectangle({0, 0, 0}, {0, 0, 4}, {2, 0, 0}), addMaterial(scene, std::make_shared<Tilted>()));
  const SurfaceHit hit = hitOf(scene, {Vec3(0.5f, 2, 3), Vec3(0, -1, 0)});
  CHECK((hit.frame.n - Vec3(0, 0.8f, 0.6f)).norm() < 1e-6f);
  CHECK((hit.normal - Vec3(0, 1, 0)).norm() < 1e-6f);
  CHECK(hit.wo.z() == Approx(0.8f));
}

TEST_CASE("render: an image is not mirrored") {
  Camera camera;
  camera.width = 200, camera.height = 100, camera.horizontalFov = 90;
  const RayCamera pinhole(camera, {});
  // Mitsuba's convention for local axes: the camera looks along +z and +x is to the left.
  CHECK((pinhole.rayThrough({100, 50}).direction - Vec3(0, 0, 1)).norm() < 1e-6f);
  CHECK((pinhole.rayThrough({0, 50}).direction - Vec3(1, 0, 1).normalized()).norm() < 1e-6f);
  CHECK((pinhole.rayThrough({100, 0}).direction - Vec3(0, 0.5f, 1).normalized()).norm() < 1e-6f);
  camera.toWorld.col(0) = -camera.toWorld.col(0);
  camera.toWorld(1, 3) = 7;
  const RayCamera turned(camera, {});
  CHECK((turned.rayThrough({0, 50}).direction - Vec3(-1, 0, 1).normalized()).norm() < 1e-6f);
  CHECK(turned.rayThrough({0, 50}).origin.y() == 7);
}

TEST_CASE("render: an orthographic camera covers −1 to 1 of its frame with parallel rays") {
  Camera camera;
  camera.kind = Camera::Kind::orthographic;
  camera.width = 200, camera.height = 100;
  camera.toWorld.topLeftCorner<3, 3>() *= 3;
  camera.toWorld(2, 3) = 5;
  const RayCamera rays(camera, {});
  CHECK((rays.rayThrough({100, 50}).origin - Vec3(0, 0, 5)).norm() < 1e-5f);
  CHECK((rays.rayThrough({0, 50}).origin - Vec3(3, 0, 5)).norm() < 1e-5f);
  CHECK((rays.rayThrough({200, 0}).origin - Vec3(-3, 1.5f, 5)).norm() < 1e-5f);
  Sampler rng(1);
  for (int x = 0; x < 200; x += 7) CHECK((rays.sample(x, x / 2, rng).direction - Vec3::UnitZ()).norm() < 1e-6f);
}

TEST_CASE("render: crop and shift translate the film") {
  Camera camera;
  camera.width = 200, camera.height = 100;
  camera.kind = GENERATE(Camera::Kind::perspective, Camera::Kind::thinlens, Camera::Kind::orthographic);
  camera.apertureRadius = 0.1f;
  const RayCamera whole(camera, {});
  const Vec2 point(17.3f, 41.2f), lens(0.3f, -0.6f);
  const auto equal = [](const Ray& a, const Ray& b) {
    return (a.origin - b.origin).norm() < 1e-5f && (a.direction - b.direction).norm() < 1e-5f;
  };
  camera.crop = FilmCrop{30, 20, 64, 48};
  const RayCamera cropped(camera, {});
  CHECK(cropped.width() == 64);
  CHECK(cropped.height() == 48);
  CHECK(equal(cropped.rayThrough(point, lens), whole.rayThrough(point + Vec2(30, 20), lens)));
  Sampler one(3), other(3);
  CHECK(equal(cropped.sample(5, 6, one), whole.sample(35, 26, other)));
  camera.shift = Vec2(0.25f, -0.1f);
  CHECK(equal(RayCamera(camera, {}).rayThrough(point, lens), whole.rayThrough(point + Vec2(80, 10), lens)));
}

TEST_CASE("render: a thin lens is sharp at the focus distance and is sampled uniformly") {
  Camera camera;
  camera.kind = Camera::Kind::thinlens;
  camera.width = 200, camera.height = 100;
  camera.apertureRadius = 0.5f, camera.focusDistance = 3;
  camera.toWorld.topLeftCorner<3, 3>() = Eigen::AngleAxisf(0.8f, Vec3(1, 2, 2) / 3).toRotationMatrix();
  camera.toWorld.topRightCorner<3, 1>() = Vec3(1, 2, 3);
  const RayCamera rays(camera, {});
  const Vec3 position = camera.toWorld.topRightCorner<3, 1>();
  const Eigen::Matrix3f toLocal = camera.toWorld.topLeftCorner<3, 3>().transpose();
  const Vec2 point(17.3f, 81.2f);
  const auto onFocus = [&](const Ray& ray) {
    const Vec3 o = toLocal * (ray.origin - position), d = toLocal * ray.direction;
    return Vec3(o + d * ((3 - o.z()) / d.z()));
  };
  const Vec3 sharp = onFocus(rays.rayThrough(point));
  camera.kind = Camera::Kind::perspective;
  CHECK((onFocus(RayCamera(camera, {}).rayThrough(point)) - sharp).norm() < 1e-5f);
  Sampler rng(5);
  for (int i = 0; i < 100; ++i)
    CHECK((onFocus(rays.rayThrough(point, squareToDisk(rng.uniform2()))) - sharp).norm() < 1e-5f);
  const auto draw = [&]() -> std::optional<Eigen::Vector2d> {
    const Vec3 lens = toLocal * (rays.sample(20, 30, rng).origin - position);
    if (!(std::abs(lens.z()) < 1e-6f)) return std::nullopt;
    const double azimuth = std::atan2(lens.y(), lens.x()) / (2 * kPi);
    return Eigen::Vector2d(lens.head<2>().squaredNorm() / 0.25, azimuth - std::floor(azimuth));
  };
  const Chi2Result result = chi2Square(draw, [](const Eigen::Vector2d&) { return 1.0; });
  INFO(result.message);
  CHECK(result.passed());
}

TEST_CASE("render: samples of filters have the moments of the filters") {
  const auto moments = [](const PixelFilter& filter) {
    const FilterSampler sampler(filter);
    Sampler rng(2);
    Moments first, second;
    float widest = 0;
    for (int i = 0; i < 200000; ++i) {
      const float x = sampler.sample(rng.uniform2()).x();
      first.add(x);
      second.add(x * x);
      widest = std::max(widest, std::abs(x));
    }
    CHECK(widest <= filter.radius);
    CHECK(deviation(first, 0) < kMaxDeviation);
    return second;
  };
  CHECK(deviation(moments({PixelFilter::Kind::box, 0.5f, 0}), 1.0 / 12) < kMaxDeviation);
  CHECK(deviation(moments({PixelFilter::Kind::tent, 1.0f, 0}), 1.0 / 6) < kMaxDeviation);
  // ∫ x² (g(x) − g(2)) / ∫ (g(x) − g(2)) over [−2, 2] for σ = 0.5.
  CHECK(deviation(moments({PixelFilter::Kind::gaussian, 2.0f, 0.5f}), 0.248571) < kMaxDeviation);
  // Filters with negative lobes are sampled where they are positive. Catmull–Rom: 1 − 5/2 x² + 3/2 |x|³ up to 1.
  CHECK(deviation(moments({PixelFilter::Kind::mitchell, 2.0f, 0, 0.0f, 0.5f}), 2.0 / 13) < kMaxDeviation);
  const auto second = [](const auto& filter, double radius) {
    double sum = 0, squares = 0;
    constexpr double kStep = 2e-4;
    for (int i = 0; i < static_cast<int>(radius / kStep); ++i) {
      const double x = (i + 0.5) * kStep;
      sum += std::max(0.0, filter(x));
      squares += std::max(0.0, filter(x)) * x * x;
    }
    return squares / sum;
  };
  const auto mitchell = [](double x) {
    return x < 1 ? 8.0 / 9 - 2 * x * x + 7.0 / 6 * x * x * x
                 : 16.0 / 9 - 10.0 / 3 * x + 2 * x * x - 7.0 / 18 * x * x * x;
  };
  CHECK(deviation(moments({PixelFilter::Kind::mitchell, 2.0f, 0}), second(mitchell, 2)) < kMaxDeviation);
  const auto lanczos = [](double x) { return 3 * std::sin(kPi * x) * std::sin(kPi * x / 3) / (kPi * kPi * x * x); };
  CHECK(deviation(moments({PixelFilter::Kind::lanczos, 3.0f, 0}), second(lanczos, 3)) < kMaxDeviation);
}

TEST_CASE("render: invalid cameras are errors") {
  Camera camera;
  SECTION("field of view") {
    camera.horizontalFov = 180;
    CHECK_THROWS_WITH(RayCamera(camera, {}), Catch::Contains("field of view"));
  }
  SECTION("size") {
    camera.width = 0;
    CHECK_THROWS_WITH(RayCamera(camera, {}), Catch::Contains("0x576"));
  }
  SECTION("crop") {
    camera.crop = FilmCrop{700, 0, 69, 10};
    CHECK_THROWS_WITH(RayCamera(camera, {}), Catch::Contains("69x10") && Catch::Contains("768x576"));
  }
  SECTION("lens") {
    camera.focusDistance = 0;
    CHECK_THROWS_WITH(RayCamera(camera, {}), Catch::Contains("focus"));
  }
  SECTION("matrix") {
    camera.toWorld.setZero();
    CHECK_THROWS_WITH(RayCamera(camera, {}), Catch::Contains("to_world"));
  }
}
