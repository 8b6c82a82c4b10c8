#pragma once
// A scene as plain data, produced by a reader and used by renderer and fitter. World units are those of the file,
// unless the scene has been rescaled (see Scene::scale).

#include <array>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Geometry>

#include "materials/bsdf.h"
#include "materials/texture.h"
#include "runtime/image/image.h"

namespace lobe {

/// World-space triangles. normals and uvs are empty or one per position. Geometric normals follow the winding
/// (counter-clockwise seen from the front).
struct TriangleMesh {
  std::vector<Vec3> positions;
  std::vector<Vec3> normals;
  std::vector<Vec2> uvs;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// A world-space sphere; the outside is the front unless flipped.
struct Sphere {
  Vec3 centre;
  float radius;
  bool flipped = false;
  /// Orthogonal matrix from the sphere's local frame, in which its texture coordinates are defined, to world space.
  Eigen::Matrix3f axes = Eigen::Matrix3f::Identity();
};

/// A flat ellipse: centre + x u + y v for x² + y² ≤ 1, where u and v are not parallel (conjugate semi-diameters; a disk
/// if they are orthogonal and of equal length); u × v points to the front unless flipped. uv: (r, φ/2π) for (x, y) = r
/// (cosφ, sinφ), as in Mitsuba.
struct Disk {
  Vec3 centre;
  Vec3 u, v;
  bool flipped = false;
};

/// The lateral surface of a right circular cylinder, open at both ends: base + cosφ u + sinφ v + h axis with h in
/// [0,1], where u and v are orthogonal to each other and to the axis, and their length is the radius. The outside is
/// the front unless flipped. uv: (φ/2π, h).
struct Cylinder {
  Vec3 base;
  Vec3 u, v;
  Vec3 axis;
  bool flipped = false;
};

/// A transformed copy of all shapes of a group.
struct Instance {
  int group;                ///< index into Scene::groups
  Eigen::Affine3f toWorld;  ///< from the group's space; invertible
};

using Geometry = std::variant<TriangleMesh, Sphere, Disk, Cylinder, Instance>;

struct AreaEmitter {
  TexturePtr radiance;  ///< emitted on the front side only
};

struct Shape {
  std::string name;  ///< for messages: the file's id, or the mesh's file name
  Geometry geometry;
  int material = -1;  ///< index into Scene::materials; −1 for instances, whose shapes have their own
  std::optional<AreaEmitter> emitter;
};

/// Shapes that are visible only through instances, in a local space of the group. None of them is an instance or an
/// emitter.
struct ShapeGroup {
  std::vector<Shape> shapes;
};

struct Material {
  std::string name;  ///< the file's id, or "unnamed-N"
  BsdfPtr bsdf;
  /// Hash of everything that the BSDF is made from: equal for identically defined materials, in every run.
  std::uint64_t fingerprint = 0;
};

/// Radiance from infinitely far away, as a latitude-longitude map. The image point (u, v), v down, holds the radiance
/// that arrives from local direction (sin(2πu) sin(πv), cos(πv), −cos(2πu) sin(πv)): +y is up (Mitsuba's convention).
struct Environment {
  Image radiance;  ///< a 1×1 image for a constant environment; scale already applied
  Eigen::Matrix3f toWorld = Eigen::Matrix3f::Identity();  ///< rotation
};

/// A point light with the same intensity in all directions.
struct PointLight {
  Vec3 position;
  Rgb intensity;  ///< power per solid angle
};

/// A texture that modulates the light from a point. On the plane at distance 1 along the light's axis, the point at an
/// offset o from the axis has the texture coordinates (½ + u·o, ½ + v·o).
struct ProjectedTexture {
  TexturePtr texture;
  Vec3 u, v;  ///< world space, orthogonal to the axis and to each other

  Vec2 uvOf(const Vec3& axis, const Vec3& direction) const {
    return Vec2(u.dot(direction), v.dot(direction)) / axis.dot(direction) + Vec2::Constant(0.5f);
  }
};

/// A point light restricted to a cone: full intensity up to the angle beamWidth from the axis, then a linear falloff in
/// the angle to zero at the cutoff, as in Mitsuba.
struct SpotLight {
  Vec3 position;
  Vec3 direction;                                          ///< unit, the axis
  Rgb intensity;                                           ///< power per solid angle, on the axis
  float cutoff;                                            ///< half angle in radians, in (0, π]
  float beamWidth;                                         ///< half angle in radians, at most the cutoff
  std::optional<ProjectedTexture> texture = std::nullopt;  ///< scales the intensity; only if the cutoff is below π/2
};

/// Projects the unit square of a texture: on a plane orthogonal to the axis at distance 1, the irradiance is π times
/// scale times the texture, as in Mitsuba, so that a white diffuse plane there shows the texture.
struct ProjectorLight {
  Vec3 position;
  Vec3 direction;  ///< unit, the axis
  float scale;
  ProjectedTexture image;
};

/// Parallel light from infinitely far away.
struct DirectionalLight {
  Vec3 direction;  ///< unit, in which the light propagates
  Rgb irradiance;  ///< on a surface orthogonal to the direction
};

/// Lights that no ray can hit.
using DeltaLight = std::variant<PointLight, SpotLight, DirectionalLight, ProjectorLight>;

/// A rectangle of a film, in pixels from its top left corner.
struct FilmCrop {
  int x, y, width, height;
};

/// Local +z is the viewing direction, +y up, +x left (Mitsuba's convention). An orthographic camera sees the local x
/// from −1 to 1, and a range of y that follows from the aspect ratio of the film.
struct Camera {
  enum class Kind { perspective, thinlens, orthographic } kind = Kind::perspective;
  Eigen::Matrix4f toWorld = Eigen::Matrix4f::Identity();
  float horizontalFov = 60;  ///< degrees, over the full image width (already converted from the file's axis for the
                             ///< size below)
  int width = 768;           ///< of the film, in pixels
  int height = 576;
  std::optional<FilmCrop> crop;  ///< part of the film that is rendered
  /// Principal point offset (Mitsuba 3's principal_point_offset): added to a film point before its ray is made, to the
  /// right and down, in fractions of the film's width and height.
  Vec2 shift = Vec2::Zero();
  float apertureRadius = 0;  ///< of a thin lens, in units of the camera's local frame
  float focusDistance = 1;   ///< from the lens to the focal plane along +z, in the same units
  /// Clipping distances along +z, in units of the camera's local frame.
  float nearClip = 0;
  float farClip = std::numeric_limits<float>::infinity();
  /// The field of view as given in the file; it is converted again when the film size is overridden.
  float fov = 60;
  std::string fovAxis = "x";

  /// The part of the film that is rendered.
  FilmCrop picture() const { return crop.value_or(FilmCrop{0, 0, width, height}); }
};

/// The reconstruction filter that the file requests.
struct PixelFilter {
  enum class Kind { box, tent, gaussian, mitchell, lanczos } kind = Kind::box;
  float radius = 0.5f;                     ///< pixels
  float stddev = 0.5f;                     ///< of the Gaussian
  float b = 1.0f / 3.0f, c = 1.0f / 3.0f;  ///< of the Mitchell–Netravali filter
};

/// How emitters appear when the camera sees them directly, not by reflection or refraction.
enum class EmitterVisibility {
  shown,
  dark,   ///< they do not emit towards the camera; emitting shapes show only their material
  hidden  ///< emitting shapes are invisible, too: the camera sees what is behind them
};

struct Scene {
  std::vector<Shape> shapes;
  std::vector<ShapeGroup> groups;
  std::vector<Material> materials;
  std::optional<Environment> environment;
  std::vector<DeltaLight> lights;  ///< except emitting shapes
  Camera camera;
  PixelFilter filter;
  std::optional<int> maxDepth;  ///< maximum path length in segments, 0 or more, from the file
  EmitterVisibility emitterVisibility = EmitterVisibility::shown;
  float scale = 1;                           ///< power of two by which all lengths of the file were multiplied
  std::vector<std::filesystem::path> files;  ///< named by the file: includes, meshes, images, measurements
  std::vector<std::string> notes;            ///< what was read but has no effect (integrators, samplers, film options)
  std::vector<std::string> warnings;         ///< what was not read as written, and what lenient reading left out
};

}  // namespace lobe
