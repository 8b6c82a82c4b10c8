#pragma once
// A lobe: a colourless part of a material for which a cache is fitted. Materials are sums of lobes with colours.
//
// Conventions in materials/: directions are in the local frame, in which z is the normal. wo is the given direction
// (towards the previous path vertex) and wi the sampled one; both point away from the surface. Densities are over solid
// angle.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "runtime/core/vec.h"

namespace lobe {

/// Whether ρ changes when wo and wi are rotated together about the normal (anisotropic).
enum class LobeKind { isotropic, anisotropic };

struct LobeSample {
  Vec3 wi;
  float pdf;  ///< over solid angle, > 0
};

/// A colourless reflection lobe over the upper hemisphere. Immutable, so safe to use from any thread.
class Lobe {
 public:
  virtual ~Lobe() = default;

  virtual LobeKind kind() const = 0;

  /// Short name of the model for file names and tables, e.g. "ggx-conductor".
  virtual std::string model() const = 0;

  /// Everything eval depends on, as canonical text: model, parameters with full precision ("{:a}" hexadecimal floats),
  /// but not the revision. Equal texts mean equal lobes.
  virtual std::string key() const = 0;

  /// A short description for people, e.g. "ggx α 0.1, dielectric 1.5".
  virtual std::string summary() const = 0;

  /// Increased whenever the code changes what eval returns; caches of other revisions are out of date.
  virtual int revision() const = 0;

  /// ρ(wo, wi) without the cosine, in luminance for lobes with spectral parameters; 0 if either direction is not above
  /// the surface.
  virtual double eval(const Vec3& wo, const Vec3& wi) const = 0;

  /// Whether ρ is unchanged when both directions are mirrored in the xz plane or in the yz plane. Fits for one quadrant
  /// of azimuths are then enough.
  virtual bool mirrorSymmetric() const { return false; }

  /// Samples wi for wo.z > 0, with u uniform in [0,1)². nullopt is a sample of value zero (e.g. below the surface),
  /// which estimators must count.
  virtual std::optional<LobeSample> sample(const Vec3& wo, const Vec2& u) const = 0;

  /// Density of sample() over solid angle; 0 for directions that it never returns.
  virtual float pdf(const Vec3& wo, const Vec3& wi) const = 0;
};

using LobePtr = std::shared_ptr<const Lobe>;

/// A lobe and the names of the materials that contain it.
struct LobeUse {
  LobePtr lobe;
  std::vector<std::string> materials;
};

}  // namespace lobe
