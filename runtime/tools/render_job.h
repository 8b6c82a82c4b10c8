#pragma once
// The options of a run of loberender.

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "runtime/image/aov.h"
#include "runtime/render/gradients/poisson.h"
#include "runtime/render/integrators/bidirectional_integrator.h"
#include "runtime/render/integrators/renderer.h"
#include "runtime/render/training/training.h"

namespace lobe {

/// automatic: path or product, whichever reaches the lower error in a pilot (pilot.h).
enum class IntegratorKind { automatic, path, bdpt, vcm, guided, product };
/// The name that the option has.
const char* nameOf(IntegratorKind kind);

/// What guides the paths of bdpt: nothing; illumination and importance; or, on camera paths, the product.
enum class BdptGuide { none, illumination, product };
/// The name that the option has.
const char* nameOf(BdptGuide guide);

/// Russian roulette by the path's throughput, or efficiency-aware Russian roulette and splitting (sample_counts.h).
enum class RussianRoulette { throughput, efficiency };

/// Whether guided and product combine camera paths with light paths. automatic: where that lowers the error in equal
/// time (light_path_plan.h).
enum class LightPathUse { automatic, on, off };
/// The name that the option has.
const char* nameOf(LightPathUse use);

struct RenderJob {
  std::filesystem::path scene;
  std::filesystem::path camera;  ///< scene file whose sensor replaces that of the scene; empty: not used
  std::map<std::string, std::string> definitions;
  bool lenient = false;
  std::filesystem::path cacheFolder = "lobes";
  std::vector<std::filesystem::path> outputs;

  IntegratorKind integrator = IntegratorKind::automatic;
  BdptGuide guide = BdptGuide::none;                  ///< only used by bdpt
  LightPathUse lightPaths = LightPathUse::automatic;  ///< only used by guided and product
  /// Radius of vertex merging of vcm in the first sample, as a fraction of the visible region's diagonal, and how it
  /// shrinks.
  MergeRadius merge{0.0015f, 0.75f};
  /// Gradient-domain rendering, and how the picture is reconstructed; empty: not used.
  std::optional<ReconstructionNorm> gradients;
  std::optional<int> samples;     ///< per pixel; exactly one of samples and seconds is set
  int sampleOffset = 0;           ///< index of the first sample of every pixel
  std::optional<double> seconds;  ///< for training and rendering together
  std::optional<std::pair<int, int>> size;
  std::optional<int> maxDepth;  ///< in segments; empty: max_depth of the scene, or no limit
  int shadowSurfaces = RenderScene::kDefaultShadowSurfaces;
  PixelSampling sampling = PixelSampling::sobol;
  PixelFiltering filtering = PixelFiltering::splatting;
  RussianRoulette russianRoulette = RussianRoulette::efficiency;
  std::optional<float> fireflyLimit;  ///< PathOptions::fireflyLimit
  std::uint64_t seed = 1;
  float reduction = 0;  ///< maximum cost of merging the mixtures of both factors (Runnalls 2007); 0: no merging
  TrainingPlan training;
  std::optional<int> passes;  ///< training passes; by default those of the plan, or unlimited if the time is limited
  std::optional<double> trainSeconds;  ///< training time; by default a fraction of seconds, or no limit

  /// Files of illumination to load, instead of training or as its start, and to save after training. Empty: not used.
  std::filesystem::path illumination, saveIllumination;

  std::filesystem::path reference, convergence, stats;  ///< empty: not used

  std::set<Aov> aovs;  ///< stored with the picture in .exr files
  ExrFormat exr;       ///< of .exr files

  /// Seconds between snapshots of the outputs while rendering; 0: none. Empty: kSnapshotSeconds if the run is expected
  /// to take longer than kLongRun, or writes checkpoints.
  std::optional<double> snapshotEvery;
  static constexpr double kSnapshotSeconds = 60, kLongRun = 120;
  std::filesystem::path checkpoint;  ///< written after training, with each snapshot and at the end; empty: not used
  std::filesystem::path resume;      ///< checkpoint to continue; empty: not used

  std::optional<std::pair<int, int>> record;         ///< pixel whose illumination record is plotted
  std::filesystem::path recordImage = "record.png";  ///< file of the plot

  /// Whether illumination is trained, from which the integrator may sample directions.
  bool guided() const;
  /// Whether stored illumination is trained further.
  bool trainsFurther() const { return !illumination.empty() && (passes || trainSeconds); }
  /// Whether next-event estimation sees through surfaces that transmit light.
  bool connectsThroughSurfaces() const {
    return integrator != IntegratorKind::bdpt && integrator != IntegratorKind::vcm;
  }
  /// Whether camera paths may be combined with light paths.
  bool mayUseLightPaths() const { return guided() && integrator != IntegratorKind::bdpt && !gradients; }
  /// Whether directions may be sampled from the product, which needs BRDF caches.
  bool mayUseProduct() const;

  /// Throws UsageError that names the option.
  void validate() const;
};

/// The lobefit command that makes the caches for a job, for error messages.
std::string lobefitCommand(const RenderJob& job);

}  // namespace lobe
