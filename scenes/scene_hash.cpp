#include "scenes/scene_hash.h"

#include "runtime/core/fingerprint.h"
#include "runtime/core/parallel.h"

namespace lobe {
namespace {

// Increase this when the same scene data starts to produce different light.
constexpr std::uint32_t kRevision = 2;

struct GeometryHash {
  Fingerprint& hash;

  void operator()(const TriangleMesh& mesh) const {
    hash.array(std::span<const Vec3>(mesh.positions));
    hash.array(std::span<const Vec3>(mesh.normals));
    hash.array(std::span<const Vec2>(mesh.uvs));
    hash.array(std::span<const std::array<std::uint32_t, 3>>(mesh.triangles));
  }
  void operator()(const Sphere& sphere) const {
    hash.coefficients(sphere.centre);
    hash.number(sphere.radius);
    hash.number(sphere.flipped);
    hash.coefficients(sphere.axes);
  }
  void operator()(const Disk& disk) const {
    for (const Vec3& v : {disk.centre, disk.u, disk.v}) hash.coefficients(v);
    hash.number(disk.flipped);
  }
  void operator()(const Cylinder& cylinder) const {
    for (const Vec3& v : {cylinder.base, cylinder.u, cylinder.v, cylinder.axis}) hash.coefficients(v);
    hash.number(cylinder.flipped);
  }
  void operator()(const Instance& instance) const {
    hash.number(instance.group);
    hash.coefficients(instance.toWorld.matrix());
  }
};

struct LightHash {
  Fingerprint& hash;

  void operator()(const ProjectedTexture& projected) const {
    hash.number(projected.texture->fingerprint());
    hash.coefficients(projected.u);
    hash.coefficients(projected.v);
  }
  void operator()(const PointLight& light) const {
    hash.coefficients(light.position);
    hash.coefficients(light.intensity);
  }
  void operator()(const SpotLight& light) const {
    hash.coefficients(light.position);
    hash.coefficients(light.direction);
    hash.coefficients(light.intensity);
    hash.number(light.cutoff);
    hash.number(light.beamWidth);
    if (light.texture) (*this)(*light.texture);
  }
  void operator()(const DirectionalLight& light) const {
    hash.coefficients(light.direction);
    hash.coefficients(light.irradiance);
  }
  void operator()(const ProjectorLight& light) const {
    hash.coefficients(light.position);
    hash.coefficients(light.direction);
    hash.number(light.scale);
    (*this)(light.image);
  }
};

std::uint64_t hashOf(const Shape& shape, const std::vector<Material>& materials) {
  Fingerprint hash;
  hash.number(shape.geometry.index());
  std::visit(GeometryHash{hash}, shape.geometry);
  hash.number(shape.material < 0 ? 0 : materials[static_cast<std::size_t>(shape.material)].fingerprint);
  hash.number(shape.emitter ? shape.emitter->radiance->fingerprint() : 0);
  return hash.value();
}

/// Hashes the shapes in parallel, because meshes are large.
void addShapes(Fingerprint& hash, const std::vector<Shape>& shapes, const std::vector<Material>& materials) {
  std::vector<std::uint64_t> hashes(shapes.size());
  parallelFor(std::size_t{0}, shapes.size(), [&](std::size_t i) { hashes[i] = hashOf(shapes[i], materials); });
  hash.array(std::span<const std::uint64_t>(hashes));
}

}  // namespace

std::uint64_t lightHash(const Scene& scene) {
  Fingerprint hash;
  hash.number(kRevision);
  addShapes(hash, scene.shapes, scene.materials);
  hash.number(scene.groups.size());
  for (const ShapeGroup& group : scene.groups) addShapes(hash, group.shapes, scene.materials);
  hash.number(scene.environment.has_value());
  if (scene.environment) {
    addTo(hash, scene.environment->radiance);
    hash.coefficients(scene.environment->toWorld);
  }
  hash.number(scene.lights.size());
  for (const DeltaLight& light : scene.lights) {
    hash.number(light.index());
    std::visit(LightHash{hash}, light);
  }
  return hash.value();
}

std::uint64_t pictureHash(const Scene& scene) {
  Fingerprint hash;
  hash.number(lightHash(scene));
  const Camera& camera = scene.camera;
  const FilmCrop picture = camera.picture();
  hash.number(camera.kind);
  hash.coefficients(camera.toWorld);
  for (const int pixels : {camera.width, camera.height, picture.x, picture.y, picture.width, picture.height})
    hash.number(pixels);
  for (const float value :
       {camera.horizontalFov, camera.shift.x(), camera.shift.y(), camera.apertureRadius, camera.focusDistance,
        camera.nearClip, camera.farClip, scene.filter.radius, scene.filter.stddev, scene.filter.b, scene.filter.c})
    hash.number(value);
  hash.number(scene.filter.kind);
  hash.number(scene.maxDepth.value_or(-1));
  hash.number(scene.emitterVisibility);
  return hash.value();
}

}  // namespace lobe
