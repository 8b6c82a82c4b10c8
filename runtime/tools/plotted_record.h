#pragma once
// The densities of a record of a BRDF cache that plots show, over the disc of wi for the direction wo of the record.

#include <cstdint>
#include <optional>
#include <span>

#include "fitter/lobe_fit.h"
#include "materials/lobe.h"
#include "runtime/analysis/disc_panel.h"
#include "schema/lobe_cache.h"

namespace lobe {

/// Densities are with respect to area of the disc; y must be inside it. The cache and the lobe must outlive the object.
class PlottedRecord {
 public:
  /// index: of a record with components. lobe: the one that the cache was fitted to; may be null.
  PlottedRecord(const LobeCache& cache, int index, const Lobe* lobe);

  std::span<const Gaussian> mixture() const { return mixture_; }
  /// G cosθ, normalised.
  double fit(const Vec2& y) const;

  bool hasTarget() const { return lobe_ != nullptr; }
  // The rest needs the lobe.
  /// ρ cosθ over the albedo.
  double target(const Vec2& y) const;
  /// Target over the graded density; 1 where both are zero, infinite where only the density is.
  double ratio(const Vec2& y) const;
  /// Nothing if there is no lobe.
  std::optional<Quality> grade() const;

  /// The whole disc, or a square around a small lobe that contains the fit and the target.
  PlotView view() const;

 private:
  const CacheRecord& record_;
  std::span<const Gaussian> mixture_;
  Vec3 wo_;
  const Lobe* lobe_;
  std::uint32_t samples_;
};

}  // namespace lobe
