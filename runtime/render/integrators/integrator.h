#pragma once
// The interface of all integrators, and path statistics.

#include <array>
#include <cstdint>

#include "lobe/surface_distribution.h"
#include "runtime/core/sampler.h"
#include "runtime/render/film/light_image.h"
#include "runtime/render/geometry/ray.h"
#include "runtime/render/integrators/contributions.h"
#include "runtime/render/integrators/photon_grid.h"

namespace lobe {

/// The quantity that a path carries: radiance against its direction (camera paths, importons), or flux along it (light
/// paths, photons).
enum class Transport { radiance, flux };

/// Techniques that sample the next direction of a path, in the order of Strategy, then delta scattering.
inline constexpr std::array<const char*, 4> kScatteringNames{"bsdf", "product", "illumination", "delta"};

/// In the order of GuidingDecision.
inline constexpr std::array<const char*, 6> kGuidingDecisionNames{"product",    "illumination", "undersampled",
                                                                  "too_narrow", "uniform",      "no_record"};

/// Counted separately by each task and summed; integer sums do not depend on the order.
struct PathStatistics {
  std::uint64_t paths = 0;
  std::uint64_t segments = 0;    ///< rays traced to extend paths
  std::uint64_t shadowRays = 0;  ///< rays traced towards lights
  std::array<std::uint64_t, kScatteringNames.size()> strategies{};
  std::array<std::uint64_t, kGuidingDecisionNames.size()> decisions{};
  LargestContributions largest;
  CutLight cut;  ///< by PathOptions::fireflyLimit

  void count(Strategy strategy) { ++strategies[static_cast<std::size_t>(strategy)]; }
  void countDelta() { ++strategies.back(); }
  void count(GuidingDecision decision) { ++decisions[static_cast<std::size_t>(decision)]; }
  std::uint64_t rays() const { return segments + shadowRays; }
  /// Work in units of one segment of plain path tracing. A shadow ray takes about half of that, and a vertex at which
  /// mixtures are used 0.6 (measured on eight scenes).
  double cost() const {
    const auto guided = static_cast<double>(decisions[static_cast<std::size_t>(GuidingDecision::product)] +
                                            decisions[static_cast<std::size_t>(GuidingDecision::illumination)] +
                                            decisions[static_cast<std::size_t>(GuidingDecision::undersampled)]);
    return static_cast<double>(segments) + 0.5 * static_cast<double>(shadowRays) + 0.6 * guided;
  }

  PathStatistics& operator+=(const PathStatistics& other) {
    paths += other.paths;
    segments += other.segments;
    shadowRays += other.shadowRays;
    for (std::size_t i = 0; i < strategies.size(); ++i) strategies[i] += other.strategies[i];
    for (std::size_t i = 0; i < decisions.size(); ++i) decisions[i] += other.decisions[i];
    largest.add(other.largest);
    cut.add(other.cut);
    return *this;
  }
};

class Integrator {
 public:
  virtual ~Integrator() = default;
  /// An unbiased estimate of the radiance that arrives along the ray. Called concurrently from many threads.
  virtual Rgb radiance(const Ray& ray, Sampler& rng, PathStatistics& statistics) const = 0;
};

/// An integrator whose light paths contribute to any pixel of the image.
class BidirectionalIntegrator {
 public:
  virtual ~BidirectionalIntegrator() = default;
  /// Whether all light paths of a sample are stored before its camera paths are traced. If so, the renderer calls
  /// beginSample with the index of the sample, storeLightPath for every pixel, and mergeWith with all photons.
  virtual bool storesLightPaths() const { return false; }
  virtual void beginSample(int sample) { (void)sample; }
  /// Appends the vertices of the light path that radiance traces with the same random numbers. Called concurrently.
  virtual void storeLightPath(Sampler& lightRng, PathStatistics& statistics, std::vector<Photon>& photons) const {
    (void)lightRng, (void)statistics, (void)photons;
  }
  virtual void mergeWith(const std::vector<Photon>& photons) { (void)photons; }

  /// One camera ray and one light path, which lightRng determines. An unbiased estimate of the sum of the radiance
  /// along all camera rays of a sample of the image, one per pixel, if the splats are added to it (LightImage). The ray
  /// must be from the camera with which the integrator was made. splats: nullptr if the ray is of the border around the
  /// image, whose light paths do not belong to the light image; the radiance is the same. Called concurrently from many
  /// threads.
  virtual Rgb radiance(const Ray& ray, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
                       std::vector<Splat>* splats) const = 0;
};

}  // namespace lobe
