#pragma once
// A scene as plain data: what a reader produces and renderer and fitter consume. World units are the file's, unless it
// is far from ordinary size (see Scene::scale).

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
  /// Orthogonal: turns the sphere's own axes, which its texture coordinates follow, into the world.
  Eigen::Matrix3f axes = Eigen::Matrix3f::Identity();
};

/// A flat ellipse: centre + x u + y v for x² + y² ≤ 1, where u and v are not parallel (conjugate radii, those of a disk
/// if they are orthogonal and equally long); u × v is the front's direction unless flipped. uv: (r, φ/2π) for
/// (x, y) = r (cosφ, sinφ), as Mitsuba has it.
struct Disk {
  Vec3 centre;
  Vec3 u, v;
  bool flipped = false;
};

/// The side of a right circular cylinder, open at both ends: base + cosφ u + sinφ v + h axis with h in [0,1], where u
/// and v are orthogonal to each other and to the axis, and as long as the radius. The outside is the front unless
/// flipped. uv: (φ/2π, h).
struct Cylinder {
  Vec3 base;
  Vec3 u, v;
  Vec3 axis;
  bool flipped = false;
};

/// All shapes of a group, once more, somewhere else.
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

/// Shapes that are shown by instances only, in a space of their own. None is an instance, and none emits.
struct ShapeGroup {
  std::vector<Shape> shapes;
};

struct Material {
  std::string name;  ///< the file's id, or "unnamed-N"
  BsdfPtr bsdf;
  /// Of what the BSDF was made from: equal for materials that are made alike, on every run.
  std::uint64_t fingerprint = 0;
};

/// Radiance from infinitely far, in latitude-longitude form. The image point (u, v), v down, shows the radiance that
/// arrives from local direction (sin(2πu) sin(πv), cos(πv), −cos(2πu) sin(πv)): +y is up (Mitsuba's convention).
struct Environment {
  Image radiance;  ///< a 1×1 image for a constant environment; scale already applied
  Eigen::Matrix3f toWorld = Eigen::Matrix3f::Identity();  ///< rotation
};

/// Equal in all directions, from a point.
struct PointLight {
  Vec3 position;
  Rgb intensity;  ///< power per solid angle
};

/// A texture in the way of light from a point. On the plane at distance 1 along the light's axis, the point at an
/// offset o from the axis has the texture coordinates (½ + u·o, ½ + v·o).
struct ProjectedTexture {
  TexturePtr texture;
  Vec3 u, v;  ///< world space, at right angles to the axis and to each other

  Vec2 uvOf(const Vec3& axis, const Vec3& direction) const {
    return Vec2(u.dot(direction), v.dot(direction)) / axis.dot(direction) + Vec2::Constant(0.5f);
  }
};

/// A cone of light from a point: of full intensity up to beamWidth from its axis, then falling linearly with the angle
/// to nothing at the cutoff (Mitsuba's).
struct SpotLight {
  Vec3 position;
  Vec3 direction;                                          ///< unit, the axis
  Rgb intensity;                                           ///< power per solid angle, on the axis
  float cutoff;                                            ///< half angle in radians, in (0, π]
  float beamWidth;                                         ///< likewise, at most the cutoff
  std::optional<ProjectedTexture> texture = std::nullopt;  ///< times the intensity; only where the cutoff is below π/2
};

/// Projects the unit square of a texture: on a plane at right angles to the axis, at distance 1, the irradiance is π
/// times scale times the texture (Mitsuba's, so that a white plane there shows the texture).
struct ProjectorLight {
  Vec3 position;
  Vec3 direction;  ///< unit, the axis
  float scale;
  ProjectedTexture image;
};

/// Parallel light from infinitely far.
struct DirectionalLight {
  Vec3 direction;  ///< unit, the way the light goes
  Rgb irradiance;  ///< on a surface that faces it
};

/// Lights that no ray can hit.
using DeltaLight = std::variant<PointLight, SpotLight, DirectionalLight, ProjectorLight>;

/// A part of a film, in pixels from its top left corner.
struct FilmCrop {
  int x, y, width, height;
};

/// Local +z is the viewing direction, +y up, +x left (Mitsuba's convention). An orthographic camera sees the local x
/// from −1 to 1, and as much of y as the film's shape makes of it.
struct Camera {
  enum class Kind { perspective, thinlens, orthographic } kind = Kind::perspective;
  Eigen::Matrix4f toWorld = Eigen::Matrix4f::Identity();
  float horizontalFov = 60;  ///< degrees, over the full image width (already converted from the file's axis for the
                             ///< size below)
  int width = 768;           ///< of the film, in pixels
  int height = 576;
  std::optional<FilmCrop> crop;  ///< what is rendered of it
  /// A film point shows what the point moved by this much (to the right and down) would show without; fractions of the
  /// film's width and height.
  Vec2 shift = Vec2::Zero();
  float apertureRadius = 0;  ///< of a thin lens, in units of the camera's frame, as is:
  float focusDistance = 1;   ///< of the plane in focus from the lens, along +z
  /// What lies nearer or farther along +z, in units of the camera's frame, is not seen.
  float nearClip = 0;
  float farClip = std::numeric_limits<float>::infinity();
  /// The field of view as the file states it, to convert again when the size is overridden.
  float fov = 60;
  std::string fovAxis = "x";

  /// The part of the film that becomes the picture.
  FilmCrop picture() const { return crop.value_or(FilmCrop{0, 0, width, height}); }
};

/// The reconstruction filter that the file asks for; sampled by importance, so each sample touches one pixel.
struct PixelFilter {
  enum class Kind { box, tent, gaussian, mitchell, lanczos } kind = Kind::box;
  float radius = 0.5f;                     ///< pixels
  float stddev = 0.5f;                     ///< of the Gaussian
  float b = 1.0f / 3.0f, c = 1.0f / 3.0f;  ///< Mitchell's and Netravali's parameters
};

/// How emitters look where the camera sees them directly, not by reflection or refraction.
enum class EmitterVisibility {
  shown,
  dark,   ///< they do not emit towards the camera, and shapes that emit are seen as what they are made of
  hidden  ///< nor are shapes that emit seen: the camera sees what is behind them
};

struct Scene {
  std::vector<Shape> shapes;
  std::vector<ShapeGroup> groups;
  std::vector<Material> materials;
  std::optional<Environment> environment;
  std::vector<DeltaLight> lights;  ///< besides the emitting shapes
  Camera camera;
  PixelFilter filter;
  std::optional<int> maxDepth;  ///< longest path in segments, 0 or more, as the file says
  EmitterVisibility emitterVisibility = EmitterVisibility::shown;
  float scale = 1;                    ///< what all lengths of the file have been multiplied by, a power of two
  std::vector<std::string> notes;     ///< what was read but replaced by ours (integrators, samplers, film options)
  std::vector<std::string> warnings;  ///< what was not taken as it stands, and what lenient reading passed over
};

}  // namespace lobe
