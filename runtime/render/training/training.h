#pragma once
// Trains the illumination field of a scene in several passes.

#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "lobe/field.h"
#include "runtime/render/training/particle_tracer.h"

namespace lobe {

/// The source of training samples.
enum class TrainFrom { photons, paths, both };
/// The names that the tools' options use.
std::map<std::string, TrainFrom> trainFromNames();

struct TrainingPlan {
  TrainFrom from = TrainFrom::both;
  /// Limit on photons and importons; the samples of as many take tens of gigabytes.
  static constexpr int kMostParticles = 100000000;

  int passes = 8;
  int photons = 300000;    ///< per pass; none are traced for TrainFrom::paths
  int importons = 100000;  ///< per pass
  /// Time limit, observed as far as pass times can be predicted: passes start small and double in size. Results then
  /// depend on the speed of the machine.
  double seconds = kInfinity;
  std::uint64_t seed = 1;
  /// PathOptions::maxDepth of the picture: the light of longer paths is not learnt.
  int maxDepth = std::numeric_limits<int>::max();
  /// Records learn BSDF sampling fractions; otherwise, and without caches, that of kProductProbabilities is used.
  bool learnFractions = true;
  bool keepParticles = false;   ///< keep those of the last pass in TrainedIllumination::particles
  bool keepImportance = false;  ///< keep what guided the photons in TrainedIllumination::importance
  FieldOptions records;         ///< except for sceneDiagonal, which training sets to that of Lights::region

  /// Throws std::runtime_error that names the field.
  void validate() const;
};

struct PassReport {
  double seconds;
  std::uint64_t particles;  ///< number of particles from which records could learn
  std::size_t records;      ///< after the pass
  /// Mean log-likelihood of the pass's particles before the update, see IlluminationTrainer::learn.
  std::optional<double> logLikelihood;
};

struct TrainingReport {
  std::vector<PassReport> passes;
  double seconds = 0;
  double undersampledFraction = 0;
  bool learntFractions = false;  ///< records have learnt BSDF sampling fractions

  std::uint64_t particles() const;
};

struct TrainedIllumination {
  Field field;
  TrainingReport report;
  SampleStorage particles;  ///< of the last pass, if kept
  Field importance;         ///< learnt from importons, if kept; without records if training traces no photons
  int maxDepth = std::numeric_limits<int>::max();  ///< TrainingPlan::maxDepth, the least of all trainings
};

/// Called with what has been learnt when the time limit of training is reached. Returns a later limit, or nullopt to
/// end the training. Its own time does not count as training.
using ExtendTraining = std::function<std::optional<double>(const Field& field)>;

/// caches: for the product; nullptr: training paths are guided by illumination only. afterPass: called after each pass
/// with its report. earlier: illumination trained for the same scene, with any camera; its records stay as they are and
/// guide the training, which adds records where none of them serves.
TrainedIllumination trainIllumination(const RenderScene& scene, const RayCamera& camera, const LobeCacheSet* caches,
                                      const TrainingPlan& plan,
                                      const std::function<void(const PassReport&)>& afterPass = {},
                                      const Field& earlier = Field(), const ExtendTraining& extend = {});

}  // namespace lobe
