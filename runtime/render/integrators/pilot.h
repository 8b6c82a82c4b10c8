#pragma once
// Compares integrators on some of the pixels, to choose the one that reaches the lower error in equal time.

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/render/film/camera.h"
#include "runtime/render/integrators/integrator.h"

namespace lobe {

struct PilotOptions {
  /// Of 2×2 pixels, at most. They are stratified in both dimensions of the image: at regular distances along its rows
  /// they would lie in a few columns, which chose product in scenes in which path is better.
  int tiles = 128;
  /// Per pixel, for each of the two independent pictures that are compared. Stratified samples reduce the variance of
  /// path tracing more than that of guided paths, which 8 samples did not show: product was chosen in scenes in which
  /// path is better.
  int samples = 32;
  std::uint64_t seed = 1;
  /// Whether costs are measured in seconds. Otherwise they are PathStatistics::cost, and the results do not depend on
  /// the machine and the number of threads.
  bool timed = false;
};

struct PilotResult {
  /// Relative variance of a pixel, mean of the channels: half the squared difference of the two pictures over
  /// m² + (median / 2)², without the worst 0.5 % of the pixels. m is the mean of the pixel's tile over all integrators,
  /// because that of the pixel would be too noisy, and the median is that of the tiles' luminance. With samples of one
  /// pixel only: PixelFiltering::splatting divides the variance of all integrators by the same factor.
  double variance = 0;
  double cost = 0;  ///< of a sample
  /// The relative variance of a picture times the time it takes.
  double inefficiency() const { return variance * cost; }
};

/// A choice between path tracing and product sampling.
struct PilotComparison {
  PilotResult path, product;
  /// Product is preferred if its inefficiency relative to that of path is below this limit.
  double limit = 1;

  double ratio() const { return product.inefficiency() / path.inefficiency(); }
  bool prefersProduct() const { return ratio() < limit; }
  /// Whether a comparison early in training must be made again at its end, because the results are close and product
  /// improves with training where path is noisy.
  bool isUndecided() const { return limit > kClearlyBetter && ratio() >= kClearlyBetter && ratio() < 1.1; }

  /// Below this ratio product has the lower error in any case. Pictures have more samples than the comparison, and path
  /// gains more from their stratification: without this margin, product was chosen in scenes in which path had the
  /// lower error.
  static constexpr double kClearlyBetter = 0.8;
};

/// brief: there is so little time for the picture that training further and comparing again may cost more than the
/// better choice gains.
PilotComparison compared(const PilotResult& path, const PilotResult& product, bool brief);

/// The results in the order of the integrators.
std::vector<PilotResult> comparePilots(const RayCamera& camera, std::span<const Integrator* const> integrators,
                                       const PilotOptions& options);

}  // namespace lobe
