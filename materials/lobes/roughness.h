#pragma once
// Internal to materials/: the microfacet distribution of a surface, whose roughness may be textured.

#include <optional>
#include <span>
#include <vector>

#include "materials/bsdf.h"
#include "materials/lobes/microfacet.h"
#include "materials/parameters.h"

namespace lobe {

/// The distribution at a point, and the two levels whose lobes stand for its own.
struct LocalRoughness {
  Microfacet microfacet;
  int level = 0;      ///< index into Roughness::levels()
  float next = 0.0f;  ///< weight in [0,1) of the level after, when > 0; the rest is the level's
};

class Roughness {
 public:
  /// distribution (default beckmann) and alpha (default 0.1), or alpha_u and alpha_v, numbers or textures, of which
  /// the luminance is taken; sample_visible is accepted, and so always. Warns of the distributions phong and as, which
  /// are taken for Beckmann's; notes a number below 1e-4, which becomes that. ParameterError: unknown distribution, a
  /// number not in [0, 10].
  static Roughness read(const Parameters& parameters);

  /// Textured values are clamped to [1e-4, 1].
  LocalRoughness at(const Vec2& uv) const;

  /// The distributions whose lobes are to be fitted, from narrow to wide: the only one, or where roughness varies the
  /// levels (roughness_levels.h) from the smallest to the largest. Levels are isotropic: where alpha_u and alpha_v
  /// differ by texture, their geometric mean counts. That is good enough, as they only guide.
  std::span<const Microfacet> levels() const { return levels_; }

  /// Whether alpha_u and alpha_v are the same.
  bool isotropic() const { return texturedU_ ? texturedU_ == texturedV_ : levels_[0].alphaU() == levels_[0].alphaV(); }

 private:
  explicit Roughness(const Microfacet& everywhere) : kind_(everywhere.kind()), levels_{everywhere} {}
  Roughness(Microfacet::Kind kind, TexturePtr alphaU, TexturePtr alphaV);

  Microfacet::Kind kind_;
  TexturePtr texturedU_, texturedV_;  ///< both or none
  double lowest_ = 0.0;               ///< levels_[0] among all levels
  std::vector<Microfacet> levels_;
};

/// Adds a lobe known at levels: firstLobe is the index of the first level's among the BSDF's.
void addLevels(LobeMixture& mixture, int firstLobe, const LocalRoughness& roughness, float tint);

}  // namespace lobe
