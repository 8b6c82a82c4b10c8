#pragma once
// A lobe: the colourless part of a material that is fitted alone. Materials are sums of lobes with colours.
//
// Conventions of all of materials/: local frame, z is the normal; wo is the given direction (towards where the path
// came from), wi the sampled one; both point away from the surface. Densities are over solid angle.

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
  /// but not the revision. Equal text means equal lobe.
  virtual std::string key() const = 0;

  /// A short text for people, e.g. "ggx α 0.1, dielectric 1.5".
  virtual std::string summary() const = 0;

  /// Raised when the code of the model changes what eval returns; a cache of another revision is stale.
  virtual int revision() const = 0;

  /// ρ(wo, wi) without the cosine, luminance for lobes with spectral parameters; 0 where either is not above the
  /// surface.
  virtual double eval(const Vec3& wo, const Vec3& wi) const = 0;

  /// Whether ρ stays the same when both directions are mirrored in the frame's x axis, and in its y axis: then the fits
  /// of a quarter of the directions are enough.
  virtual bool mirrorSymmetric() const { return false; }

  /// Draws wi for wo.z > 0 from u uniform in [0,1)². nullopt: the sample has value zero (below the surface, say), and
  /// counts as a sample.
  virtual std::optional<LobeSample> sample(const Vec3& wo, const Vec2& u) const = 0;

  /// The density of sample; 0 where it never draws.
  virtual float pdf(const Vec3& wo, const Vec3& wi) const = 0;
};

using LobePtr = std::shared_ptr<const Lobe>;

/// A lobe and the names of the materials that have it.
struct LobeUse {
  LobePtr lobe;
  std::vector<std::string> materials;
};

}  // namespace lobe
