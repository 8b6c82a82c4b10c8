#pragma once
// Procedural scenes, simple materials and statistics for the render tests.

#include <cmath>
#include <filesystem>
#include <memory>
#include <string>

#include <catch2/catch.hpp>

#include "runtime/core/sampling.h"
#include "runtime/render/integrators/path_integrator.h"
#include "tests/support/moments.h"
#include "tests/support/tool_run.h"

namespace lobe::test {

/// A two-sided Lambertian reflector.
class Diffuse : public Bsdf {
 public:
  explicit Diffuse(float albedo) : albedo_(albedo) {}
  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2&) const override {
    return wo.z() * wi.z() > 0 ? grey(albedo_ * kInvPi) : Rgb(Rgb::Zero());
  }
  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float, const Vec2& u) const override {
    Vec3 wi = squareToCosineHemisphere(u);
    if (wi.z() <= 0) return std::nullopt;
    if (wo.z() < 0) wi.z() = -wi.z();
    return BsdfSample{wi, eval(wo, wi, uv), pdf(wo, wi, uv)};
  }
  float pdf(const Vec3& wo, const Vec3& wi, const Vec2&) const override {
    return wo.z() * wi.z() > 0 ? std::abs(wi.z()) * kInvPi : 0;
  }
  LobeMixture mixture(const Vec3&, const Vec2&) const override { return {{}, 0, albedo_}; }
  Rgb albedo(const Vec3&, const Vec2&) const override { return grey(albedo_); }

 private:
  float albedo_;
};

/// A perfect mirror of reflectance `mirror` plus a Lambertian; `fraction` is the probability of sampling the mirror.
class HalfMirror : public Diffuse {
 public:
  HalfMirror(float albedo, float mirror, float fraction) : Diffuse(albedo), mirror_(mirror), fraction_(fraction) {}
  std::optional<DeltaSample> sampleDelta(const Vec3& wo, const Vec2&, float) const override {
    return DeltaSample{{-wo.x(), -wo.y(), wo.z()}, grey(mirror_), 1.0f};
  }
  float deltaProbability(const Vec3&, const Vec2&) const override { return fraction_; }

 private:
  float mirror_, fraction_;
};

/// The rectangle a, a+u, a+u+v, a+v; u × v points to its front.
inline TriangleMesh rectangle(const Vec3& a, const Vec3& u, const Vec3& v) {
  TriangleMesh mesh;
  mesh.positions = {a, a + u, a + u + v, a + v};
  mesh.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

/// A closed axis-aligned box whose front faces outward, or inward.
inline TriangleMesh box(const Vec3& low, const Vec3& high, bool inward) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.positions.push_back({i & 1 ? high.x() : low.x(), i & 2 ? high.y() : low.y(), i & 4 ? high.z() : low.z()});
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  if (inward)
    for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

/// A tessellated sphere with smooth normals.
inline TriangleMesh sphereMesh(const Vec3& centre, float radius, int rings) {
  TriangleMesh mesh;
  for (int i = 0; i <= rings; ++i)
    for (int j = 0; j <= 2 * rings; ++j) {
      const float theta = kPi * i / rings, phi = kPi * j / rings;
      const Vec3 n(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta));
      mesh.positions.push_back(centre + radius * n);
      mesh.normals.push_back(n);
    }
  const auto stride = static_cast<std::uint32_t>(2 * rings + 1);
  for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(rings); ++i)
    for (std::uint32_t j = 0; j + 1 < stride; ++j) {
      const std::uint32_t a = i * stride + j, b = a + stride;
      mesh.triangles.push_back({a, b, b + 1});
      mesh.triangles.push_back({a, b + 1, a + 1});
    }
  return mesh;
}

inline int addMaterial(Scene& scene, BsdfPtr bsdf) {
  scene.materials.push_back({"test", std::move(bsdf)});
  return static_cast<int>(scene.materials.size()) - 1;
}

inline Shape& addShape(Scene& scene, Geometry geometry, int material) {
  scene.shapes.push_back({"test", std::move(geometry), material, std::nullopt});
  return scene.shapes.back();
}

inline void addEmitter(Scene& scene, Geometry geometry, float radiance, int material = -1) {
  addShape(scene, std::move(geometry), material).emitter = AreaEmitter{constantTexture(grey(radiance))};
}

inline Environment environment(Image image) {
  return {std::move(image), Eigen::Matrix3f::Identity()};
}

/// The green channel of n radiance estimates along one ray.
inline Moments estimate(const Integrator& integrator, const Ray& ray, int n, std::uint64_t seed = 7) {
  Moments moments;
  PathStatistics statistics;
  for (int i = 0; i < n; ++i) {
    Sampler rng(seed, 0, i);
    moments.add(integrator.radiance(ray, rng, statistics).y());
  }
  return moments;
}

}  // namespace lobe::test
