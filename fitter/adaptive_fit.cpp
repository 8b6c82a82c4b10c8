#include "fitter/adaptive_fit.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>
#include <vector>

#include <Eigen/LU>

#include "fitter/lobe_draws.h"
#include "fitter/lobe_fit.h"
#include "runtime/core/parallel.h"
#include "runtime/mixture/lookup.h"

namespace lobe {
namespace {

// More components must lower the second moment by this fraction of the requested quality to be worth their cost at
// every look-up.
constexpr double kWorthwhile = 0.25;

/// Numbers of components to try after one, up to `most`.
std::vector<std::uint32_t> sizesUpTo(std::uint32_t most) {
  std::vector<std::uint32_t> sizes;
  for (const std::uint32_t size : {2, 3, 4, 6, 8, 12, 16, 24})
    if (size < most) sizes.push_back(size);
  sizes.push_back(most);
  return sizes;
}

// Decisions need fewer points than the stored grades.
constexpr std::uint32_t kDecisionFraction = 4;
// This standard deviation on the disc is over ten times smaller than that of the initial incident-radiance mixtures.
constexpr double kTooNarrow = 0.004;
constexpr std::uint32_t kTooNarrowRecords = 8;

double secondMoment(const FittedRecord& fitted) {
  return 1.0 + fitted.largerVariance();
}

/// The standard deviation of the lobe along its narrower axis, at normal incidence.
double widthOf(const Lobe& lobe) {
  constexpr std::uint32_t points = 256;
  const Vec3 wo = Vec3(0.01f, 0.01f, 1).normalized();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  double weight = 0;
  for (const LobeDraw& d : drawLobe(lobe, wo, 0, points)) {
    // Down-weight the tails: a narrow peak with long tails counts as narrow.
    const Eigen::Vector2d y = (toDisc(d.wi) + toDisc(wo)).cast<double>();
    const double w = d.value / d.pdf / (1 + y.squaredNorm() / (kTooNarrow * kTooNarrow));
    squares += w * y * y.transpose();
    weight += w;
  }
  if (!(weight > 0)) return 1;
  const Eigen::Matrix2d covariance = squares / weight;
  const double half = 0.5 * covariance.trace();
  return std::sqrt(std::max(0.0, half - std::sqrt(std::max(0.0, half * half - covariance.determinant()))));
}

bool usesQuarter(const Lobe& lobe, const DirectionGrid& grid) {
  return grid.kind == GridKind::fibonacci && lobe.mirrorSymmetric();
}

/// The grid entries to visit, from coarse to fine, in bit-reversed order.
std::vector<int> entriesOf(const Lobe& lobe, const DirectionGrid& grid) {
  std::vector<int> candidates;
  for (int i = 0; i < grid.count; ++i) {
    const Vec3 w = grid.direction(i);
    if (!usesQuarter(lobe, grid) || (w.x() >= 0 && w.y() >= 0)) candidates.push_back(i);
  }
  // A very small grid may have no direction in the quadrant.
  if (candidates.empty()) candidates.push_back(0);
  const std::size_t size = std::bit_ceil(candidates.size());
  std::vector<int> ordered;
  for (std::size_t i = 0; i < size; ++i) {
    std::size_t reversed = 0;
    for (std::size_t bit = 1, mirrored = size / 2; bit < size; bit *= 2, mirrored /= 2)
      if (i & bit) reversed |= mirrored;
    if (reversed < candidates.size()) ordered.push_back(candidates[reversed]);
  }
  return ordered;
}

/// Fits mixtures for one direction and knows the quality target there.
class DirectionFits {
 public:
  DirectionFits(const Lobe& lobe, const Vec3& wo, const FitSettings& settings)
      : fitter_(lobe, wo, settings.samples), settings_(settings), sizes_(sizesUpTo(settings.components)) {
    // For the many records of an anisotropic lobe, this would take most of the fitting time.
    if (lobe.kind() != LobeKind::isotropic) return;
    most_ = byWeightedEm(settings.components);
    const float factor = std::max(1.0f, settings.quality / kDefaultQuality);
    settings_.quality = std::min(settings.quality, factor * most_->largerVariance());
  }

  double target() const { return settings_.quality; }

  FittedRecord fewest() const { return more(with(1), 2); }

  /// Starts from the mixture of a neighbouring direction.
  FittedRecord from(std::span<const Gaussian> start) const {
    FittedRecord fitted = refined(start);
    if (goodEnough(fitted)) return less(std::move(fitted));
    // Retry with the same number of components from scratch: the start may have been too far from a good optimum.
    const std::uint32_t first = fitted.record.count;
    return more(std::move(fitted), first);
  }

 private:
  bool goodEnough(const FittedRecord& fitted) const { return secondMoment(fitted) <= 1.0 + settings_.quality; }

  FittedRecord byWeightedEm(std::uint32_t components) const {
    FitSettings settings = settings_;
    settings.method = FitMethod::wem;
    settings.components = components;
    return fitter_.fit(settings);
  }

  FittedRecord refined(std::span<const Gaussian> start) const {
    FitSettings settings = settings_;
    settings.method = FitMethod::ceres;
    return fitter_.fit(settings, start);
  }

  /// Weighted EM, followed by least squares if that is not good enough.
  FittedRecord with(std::uint32_t components) const {
    FittedRecord fitted = most_ && components == settings_.components ? *most_ : byWeightedEm(components);
    return goodEnough(fitted) ? fitted : refined(fitted.mixture);
  }

  /// Tries `first` and more components until the fit is good enough; keeps more components only if they are worth it.
  FittedRecord more(FittedRecord best, std::uint32_t first) const {
    for (const std::uint32_t size : sizes_) {
      if (goodEnough(best)) break;
      if (size < first) continue;
      FittedRecord fitted = with(size);
      const double gain = 1 - secondMoment(fitted) / secondMoment(best);
      if (gain > kWorthwhile * settings_.quality) best = std::move(fitted);
    }
    return best;
  }

  /// Reduces the number of components while the fit stays good enough.
  FittedRecord less(FittedRecord best) const {
    for (std::size_t i = sizes_.size(); i-- > 0;) {
      if (sizes_[i] >= best.record.count) continue;
      FittedRecord fitted = with(sizes_[i]);
      if (!goodEnough(fitted)) break;
      best = std::move(fitted);
    }
    return best;
  }

  DirectionFitter fitter_;
  FitSettings settings_;
  std::vector<std::uint32_t> sizes_;  // numbers of components, increasing
  std::optional<FittedRecord> most_;  // weighted EM with the largest number of components
};

class AdaptiveFitter {
 public:
  AdaptiveFitter(const Lobe& lobe, const DirectionGrid& grid, const FitSettings& settings)
      : lobe_(lobe), grid_(grid), settings_(settings) {}

  /// Directions of one level use only the records of previous levels, so their order does not affect the result.
  void fit(const std::function<void()>& advance) {
    const std::vector<int> entries = entriesOf(lobe_, grid_);
    for (std::size_t begin = 0; begin < entries.size();) {
      const std::size_t end = std::min(entries.size(), std::max<std::size_t>(1, 2 * begin));
      std::vector<std::optional<Fit>> fitted(end - begin);
      parallelFor(begin, end, [&](std::size_t i) {
        fitted[i - begin] = fitWhereNeeded(entries[i]);
        if (advance) advance();
      });
      for (std::size_t i = begin; i < end; ++i)
        if (fitted[i - begin]) add(entries[i], std::move(fitted[i - begin]->record), fitted[i - begin]->target);
      begin = end;
    }
  }

  void leaveToBsdf(const std::function<void()>& advance) {
    const std::vector<int> entries = entriesOf(lobe_, grid_);
    for (std::size_t i = 0; i < entries.size(); ++i) {
      if (i < kTooNarrowRecords)
        add(entries[i], withoutComponents(lobe_, grid_.direction(entries[i]), settings_.samples), 0);
      if (advance) advance();
    }
  }

  FittedGrid result() const {
    FittedGrid result;
    for (const FittedRecord& f : records_) result.append(f, f.record.entry);
    for (int i = 0; i < grid_.count; ++i) result.lookup.push_back(nearestRecord(grid_.direction(i)));
    result.quarter = usesQuarter(lobe_, grid_);
    return result;
  }

 private:
  struct Fit {
    FittedRecord record;
    double target;
  };

  std::uint32_t nearestRecord(const Vec3& wo) const {
    const Vec2 y = toDisc(usesQuarter(lobe_, grid_) ? Mirror::intoQuadrant(wo)(wo) : wo);
    const auto nearest =
        std::ranges::min_element(references_, {}, [&](const Vec2& reference) { return (reference - y).squaredNorm(); });
    return static_cast<std::uint32_t>(nearest - references_.begin());
  }

  /// The nearest record; nullopt if there is none that has components.
  std::optional<std::uint32_t> nearestMixture(const Vec3& wo) const {
    if (records_.empty()) return std::nullopt;
    const std::uint32_t found = nearestRecord(wo);
    return records_[found].mixture.empty() ? std::nullopt : std::optional(found);
  }

  std::optional<Fit> fitWhereNeeded(int entry) const {
    const Vec3 wo = grid_.direction(entry);
    const std::optional<std::uint32_t> neighbour = nearestMixture(wo);
    try {
      return neighbour ? fitUnlessServed(wo, *neighbour) : fitAlone(wo);
    } catch (const TooNarrow&) {
      // A record without components serves it, too.
      if (!neighbour && !records_.empty()) return std::nullopt;
      return Fit{withoutComponents(lobe_, wo, settings_.samples), 0};
    }
  }

  Fit fitAlone(const Vec3& wo) const {
    const DirectionFits fits(lobe_, wo, settings_);
    return {fits.fewest(), fits.target()};
  }

  std::optional<Fit> fitUnlessServed(const Vec3& wo, std::uint32_t found) const {
    const FittedRecord& neighbour = records_[found];
    Mixture aligned(neighbour.mixture.size());
    alignMixture({grid_.kind, references_[found], {}}, neighbour.mixture, wo, aligned);
    const Quality served = gradeMixture(lobe_, wo, aligned, settings_.samples / kDecisionFraction);
    const double moment = 1 + served.largerVariance();
    // A look-up may be worse than a fit for this direction by the same factor as a fit may be worse than the lobe.
    if (moment <= (1 + targets_[found]) * secondMoment(neighbour)) return std::nullopt;
    const DirectionFits fits(lobe_, wo, settings_);
    FittedRecord fitted = fits.from(aligned);
    // Where the lobe is hard to fit, another record would not help.
    if (moment <= (1 + fits.target()) * secondMoment(fitted)) return std::nullopt;
    return Fit{std::move(fitted), fits.target()};
  }

  void add(int entry, FittedRecord fitted, double target) {
    fitted.record.entry = static_cast<std::uint32_t>(entry);
    references_.push_back(toDisc(grid_.direction(entry)));
    records_.push_back(std::move(fitted));
    targets_.push_back(target);
  }

  const Lobe& lobe_;
  const DirectionGrid& grid_;
  const FitSettings& settings_;
  std::vector<FittedRecord> records_;
  std::vector<Vec2> references_;  // on the disc, one per record
  std::vector<double> targets_;   // quality targets, one per record
};

}  // namespace

FittedRecord fitWithFewest(const Lobe& lobe, const Vec3& wo, const FitSettings& settings) {
  return DirectionFits(lobe, wo, settings).fewest();
}

int adaptiveDirections(const Lobe& lobe, const DirectionGrid& grid) {
  return static_cast<int>(entriesOf(lobe, grid).size());
}

FittedGrid fitAdaptively(const Lobe& lobe, const DirectionGrid& grid, const FitSettings& settings,
                         const std::function<void()>& advance) {
  AdaptiveFitter fitter(lobe, grid, settings);
  if (widthOf(lobe) < kTooNarrow)
    fitter.leaveToBsdf(advance);
  else
    fitter.fit(advance);
  return fitter.result();
}

}  // namespace lobe
