#pragma once
// Internal to materials/: the microfacet distribution of a surface, whose roughness may be textured.

#include <optional>
#include <span>
#include <vector>

#include "materials/bsdf.h"
#include "materials/lobes/microfacet.h"
#include "materials/parameters.h"

namespace lobe {

/// The distribution at a point, and the two roughness levels whose lobes approximate its lobe.
struct LocalRoughness {
  Microfacet microfacet;
  int level = 0;      ///< index into Roughness::levels()
  float next = 0.0f;  ///< weight in [0,1) of level + 1; level itself has weight 1 − next
};

class Roughness {
 public:
  /// Reads distribution (default beckmann) and alpha (default 0.1), or alpha_u and alpha_v, as numbers or textures (by
  /// evalNumber). sample_visible is accepted but ignored: visible normals are always sampled. The distributions phong
  /// and as are replaced by beckmann, with a warning; numbers below 1e-4 are replaced by it, with a note. Throws
  /// ParameterError for an unknown distribution or a number outside [0, 10].
  static Roughness read(const Parameters& parameters);

  /// Textured values are clamped to [1e-4, 1].
  LocalRoughness at(const Vec2& uv) const;

  /// The distributions whose lobes are fitted, from narrow to wide: a single one, or for a textured roughness all
  /// levels (roughness_levels.h) from the smallest to the largest. Levels are isotropic: where textured alpha_u and
  /// alpha_v differ, their geometric mean is used, which is accurate enough for guiding.
  std::span<const Microfacet> levels() const { return levels_; }

  /// Whether alpha_u and alpha_v are equal.
  bool isotropic() const { return texturedU_ ? texturedU_ == texturedV_ : levels_[0].alphaU() == levels_[0].alphaV(); }

 private:
  explicit Roughness(const Microfacet& everywhere) : kind_(everywhere.kind()), levels_{everywhere} {}
  Roughness(Microfacet::Kind kind, TexturePtr alphaU, TexturePtr alphaV);

  Microfacet::Kind kind_;
  TexturePtr texturedU_, texturedV_;  ///< both or neither
  double lowest_ = 0.0;               ///< index of levels_[0] among all levels
  std::vector<Microfacet> levels_;
};

/// Adds the lobes of the two levels to a mixture; firstLobe is the index of the first level's lobe in the BSDF.
void addLevels(LobeMixture& mixture, int firstLobe, const LocalRoughness& roughness, float tint);

}  // namespace lobe
