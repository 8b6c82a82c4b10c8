#pragma once
// Trains the illumination of a scene, pass by pass.

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "lobe/field.h"
#include "runtime/render/training/particle_tracer.h"

namespace lobe {

/// What records learn from.
enum class TrainFrom { photons, paths, both };
/// As the tools' options spell them.
std::map<std::string, TrainFrom> trainFromNames();

struct TrainingPlan {
  TrainFrom from = TrainFrom::both;
  int passes = 8;
  int photons = 300000;    ///< a pass; none are traced for TrainFrom::paths
  int importons = 100000;  ///< a pass
  /// Passes end by then, as far as can be foreseen: they begin small and double. Results depend on the machine's speed.
  double seconds = kInfinity;
  std::uint64_t seed = 1;
  bool learnFractions =
      true;  ///< of the BSDF, by record, else kProductProbabilities; without caches there is nothing to learn
  bool keepParticles = false;  ///< of the last pass, for TrainedIllumination::particles
  FieldOptions records;        ///< but for the scene's diagonal, which training sets

  /// Throws std::runtime_error that names the field.
  void validate() const;
};

struct PassReport {
  double seconds;
  std::uint64_t particles;  ///< that records could learn from
  std::size_t records;      ///< after the pass
  /// Of the pass's particles before they were learnt from, see IlluminationTrainer::learn.
  std::optional<double> logLikelihood;
};

struct TrainingReport {
  std::vector<PassReport> passes;
  double seconds = 0;
  double undersampledFraction = 0;
  bool learntFractions = false;  ///< records know how often the BSDF is to choose

  std::uint64_t particles() const;
};

struct TrainedIllumination {
  Field field;
  TrainingReport report;
  SampleStorage particles;  ///< of the last pass, where kept
};

/// caches: for the product; nullptr: paths in training are guided by illumination only. afterPass: called with what
/// each pass did.
TrainedIllumination trainIllumination(const RenderScene& scene, const RayCamera& camera, const LobeCacheSet* caches,
                                      const TrainingPlan& plan,
                                      const std::function<void(const PassReport&)>& afterPass = {});

}  // namespace lobe
