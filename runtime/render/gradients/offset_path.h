#pragma once
// Offset paths: a path through a pixel, the base path, is shifted to a neighbouring pixel (Kettunen et al. 2015,
// "Gradient-Domain Path Tracing", Section 5). Paths are parameterised by their position on the film and by the
// directions, over solid angle, in which they leave the vertices where they were not scattered by a delta component.
//
// At a vertex, the offset path
// - is connected to the next vertex of the base path if both paths scatter broadly there (kBroad) and the next vertex
// is
//   not purely specular (light at infinity is in the same direction for both);
// - otherwise copies the half vector of the base path, or its delta component.
// After a connection both paths have the same vertices. If the shift does not lead back from the offset path to the
// base path, or if the offset path has no light, there is no offset path: the base path contributes to the difference
// of the pixels with its full weight.

#include <optional>

#include "runtime/render/lights/render_scene.h"

namespace lobe {

/// A vertex scatters broadly in a direction if the BSDF is at most this multiple of a Lambertian BSDF of the same
/// albedo. Microfacet lobes exceed it around their peak if their roughness α is below about 0.016. Neighbouring pixels
/// see a surface in directions so similar that wider lobes hardly differ; with a value of 3 (α 0.3), errors were up to
/// 60 % higher, and without a limit, twice as high on nearly smooth metal.
inline constexpr float kBroad = 1000;

bool scattersBroadly(const SurfaceHit& hit, const Rgb& f);

/// Whether an offset path may be connected to the vertex from where it is seen: something other than a delta component
/// scatters light there, or it emits, or the path ends there.
bool connectable(const SurfaceHit& hit);

/// Whether scattering from wi (local) happens on corresponding sides of the surfaces, so that it may be shifted from
/// `base` to `offset`: reflection to reflection, and transmission to transmission through the same material from the
/// same side, which has the same index of refraction.
bool correspond(const SurfaceHit& base, const Vec3& baseWi, const SurfaceHit& offset, const Vec3& offsetWi);

/// |∂ω'/∂ω| for the directions ω and ω' in which two vertices see the same point of a surface, as the point moves on
/// the surface. base and offset: the vectors from the vertices to the point; normal: unit, of the surface.
float connectionJacobian(const Vec3& normal, const Vec3& base, const Vec3& offset);

/// The component of the delta part of the BSDF (DeltaSample::component); nullopt if there is none. An improbable
/// component may not be found between others that have no sample.
std::optional<DeltaSample> deltaComponent(const SurfaceHit& hit, double component);

struct OffsetPath {
  enum class State {
    apart,      ///< the offset path is at a vertex of its own
    connected,  ///< it has reached the base path's vertex from another direction
    merged,     ///< its vertex and direction are those of the base path
    failed      ///< there is no offset path
  };
  State state = State::failed;
  std::optional<SurfaceHit> hit;  ///< apart and connected: the vertex as the offset path sees it
  Vec3 direction = Vec3::Zero();  ///< apart: in which it has arrived
  Rgb throughput = Rgb::Ones();   ///< of the offset path · Jacobian of the shift / density of the base path
  float ratio = 1;                ///< density of the offset path · Jacobian / density of the base path, > 0
  Rgb expected = Rgb::Ones();     ///< product of the albedos, for Russian roulette
  float eta2 = 1;                 ///< scaling of radiance by refraction

  bool exists() const { return state != State::failed; }
  /// Whether the vertex has data of its own.
  bool isSeparate() const { return state == State::apart || state == State::connected; }
  void fail() { state = State::failed; }
  /// Multiplies throughput and ratio; fails if a factor is zero.
  void scale(const Rgb& contribution, float density);
};

/// What one path of a pair of base and offset path contributes with one technique, next-event estimation for example.
/// All densities are relative to that with which the technique has sampled the base path, and include the Jacobian.
struct Contribution {
  Rgb value;          ///< contribution · Jacobian / density of the base path
  double group2 = 1;  ///< sum of the squared densities of the techniques that shift the path alike, this one included
  double total2 = 1;  ///< sum of the squared densities of all techniques

  Contribution(const Rgb& v, double group, double total) : value(v), group2(group), total2(total) {}
  /// The value of a base path with its multiple importance weight.
  Rgb weighted() const { return value * static_cast<float>(1.0 / total2); }
};

/// The weighted difference of base and offset path. The techniques that shift the base path to the same offset path
/// estimate the difference of their common part of the pixels, what their multiple importance weights leave of them:
/// the ways in which they sample the pair, from both sides, are combined by the power heuristic. offset: nullopt if
/// there is none.
Rgb weightedDifference(const Contribution& base, const std::optional<Contribution>& offset);
/// The same if all techniques are in one group, or each is in its own.
Rgb weightedDifference(Contribution base, std::optional<Contribution> offset, bool sameShift);

}  // namespace lobe
