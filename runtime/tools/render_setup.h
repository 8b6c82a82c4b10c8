#pragma once
// What a run of loberender prepares before the first sample: caches, trained illumination, and the integrator.

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "runtime/guiding/brdf_caches.h"
#include "runtime/render/gradients/gradient_integrator.h"
#include "runtime/render/integrators/bidirectional_integrator.h"
#include "runtime/render/integrators/guided_integrator.h"
#include "runtime/render/integrators/pilot.h"
#include "runtime/render/integrators/renderer.h"
#include "runtime/render/integrators/sample_counts.h"
#include "runtime/render/training/light_path_plan.h"
#include "runtime/render/training/training.h"
#include "runtime/tools/render_job.h"
#include "schema/illumination_file.h"

namespace lobe {

/// Names and values of everything that determines a picture, in the order in which differences are reported.
using RunSettings = std::vector<std::pair<std::string, std::string>>;

/// The comparison of path and product for IntegratorKind::automatic.
struct Pilot : PilotComparison {
  double seconds = 0;        ///< of all comparisons
  bool provisional = false;  ///< the comparison is to be made again after training
};

/// BRDF caches and trained illumination; both are empty without guiding. Cannot be moved, because the samplers refer to
/// the other members.
struct Guiding {
  Guiding() = default;
  Guiding(const Guiding&) = delete;
  Guiding& operator=(const Guiding&) = delete;

  std::optional<LobeCacheSet> caches;
  TrainedIllumination training;
  std::optional<GuidedSampler> sampler;
  std::optional<GuidedSampler> lightSampler;  ///< of the light paths of bdpt
  std::optional<SampleCountModel> counts;
  double secondsLights = 0;  ///< time for learning the choice of lights
  double secondsCounts = 0;  ///< time for learning the counts
  std::optional<Pilot> pilot;
  std::optional<EnvironmentGuide> environmentGuide;  ///< of the light paths of guided and product
  std::optional<LightPathTrial> lightPaths;          ///< if they were tried
  bool usesLightPaths = false;
  double secondsLightPaths = 0;  ///< time for trying them

  /// Time spent before rendering.
  double seconds() const {
    return secondsLights + training.report.seconds + secondsCounts + (pilot ? pilot->seconds : 0) + secondsLightPaths;
  }
  /// Whether the pilot has chosen path.
  bool prefersPath() const { return pilot && !pilot->provisional && !pilot->prefersProduct(); }
  const LobeCacheSet* cachesOrNull() const { return caches ? &*caches : nullptr; }
  std::size_t unreducedBytes = 0;  ///< size of the records before merging

  void reduceRecords(float threshold) {
    unreducedBytes = training.field.bytes();
    if (threshold > 0) training.field = training.field.reduced(threshold);
  }
};

using AnyIntegrator =
    std::variant<std::unique_ptr<Integrator>, std::unique_ptr<BidirectionalIntegrator>,
                 std::unique_ptr<GradientIntegrator>, std::unique_ptr<BidirectionalGradientIntegrator>>;

/// The plan of training for the options.
TrainingPlan planOf(const RenderJob& job, const Scene& scene);

/// Trains the illumination, with a progress line. Sets guiding.training, starting with what it holds.
void train(const RenderJob& job, const TrainingPlan& plan, const RenderScene& scene, const RayCamera& camera,
           Guiding& guiding);

/// Everything that determines the samples of a picture, except for their number and time limits of training.
RunSettings settingsOf(const RenderJob& job, const Scene& scene, const Guiding& guiding,
                       const std::optional<IlluminationFile>& stored);

/// The integrator of the job. Learns the counts of samples if it uses them, and sets guiding.counts; for
/// IntegratorKind::automatic, compares path and product, and sets guiding.pilot; tries light paths, and sets
/// guiding.lightPaths; does neither again if they are set. The integrator refers to `guiding`.
AnyIntegrator makeIntegrator(const RenderJob& job, const RenderScene& scene, const RayCamera& camera, Guiding& guiding);

}  // namespace lobe
