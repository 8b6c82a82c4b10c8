#pragma once
// Decides whether light paths (light_tracing.h) pay in a picture, and how many.
//
// Camera paths whose variance is dominated by rare outliers do not show it in a trial: most trials have none. Light
// paths do. If a light path with density p makes a contribution f that the techniques of camera paths make with density
// q, the mean of f²/(q p) over light paths is ∫ f²/q, the second moment of the camera paths' estimate, and it has a low
// variance where light paths are dense. The multiple importance weights give the parts of it that are left to either
// technique for any number of light paths.

#include <cstdint>

#include "runtime/render/integrators/bidirectional_integrator.h"
#include "runtime/render/lights/environment_guide.h"

namespace lobe {

/// Means over the pixels of a picture, for one sample of a pixel: variances relative to the squared value of the pixel
/// (bounded from below by that of dark pixels), costs as from PathStatistics::cost.
struct LightPathTrial {
  double variance = 0;          ///< of camera paths alone, as far as a trial of them shows it, without the worst 0.5 %
  double cost = 0;              ///< of camera paths alone
  double pathsPerPixel = 0;     ///< light paths
  double secondMoment = 0;      ///< of camera paths alone, for the light that light paths find
  double secondMomentLeft = 0;  ///< what light paths leave of it: of the weighted camera paths, and their own
  double costWithLight = 0;     ///< of camera and light paths

  /// The variance of camera paths alone includes the outliers that the trial of them may have missed.
  double inefficiency() const;
  double inefficiencyWithLight() const;
};

/// Learns where photons from the environment should start from camera paths, which the guide samples.
EnvironmentGuide learnEnvironmentGuide(const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                                       const GuidedSampler& guide, int paths, std::uint64_t seed);

/// Compares camera paths with and without light paths that start as `emission` says, for the best number of light
/// paths. paths: number of camera paths and of light paths, > 0. The result does not depend on the number of threads.
LightPathTrial tryLightPaths(const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                             const GuidedSampler& guide, const PhotonEmission& emission, int paths, std::uint64_t seed);

}  // namespace lobe
