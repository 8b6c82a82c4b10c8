#pragma once
// What loberender does, from options to files.

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "runtime/image/image.h"
#include "runtime/render/integrators/path_loop.h"
#include "runtime/render/training/training.h"

namespace lobe {

enum class IntegratorKind { path, guided, product };

struct RenderJob {
  std::filesystem::path scene;
  std::map<std::string, std::string> definitions;
  bool lenient = false;
  std::filesystem::path cacheFolder = "lobes";
  std::vector<std::filesystem::path> outputs;

  IntegratorKind integrator = IntegratorKind::product;
  std::optional<int> samples;     ///< per pixel; or
  int sampleOffset = 0;           ///< the first of the samples, of so many a pixel
  std::optional<double> seconds;  ///< of training and rendering together
  std::optional<std::pair<int, int>> size;
  std::optional<int> maxDepth;  ///< segments
  RussianRoulette russianRoulette = RussianRoulette::adjoint;
  std::uint64_t seed = 1;
  float reduction = 0;  ///< threshold of cost up to which the mixtures of both factors are merged; 0: not at all
  TrainingPlan training;
  std::optional<int> passes;           ///< of training; by default the plan's, or without limit where time is one
  std::optional<double> trainSeconds;  ///< no pass starts after that; by default a share of seconds, else no limit

  /// Trained before, instead of training; where to keep what is trained. Empty: neither.
  std::filesystem::path illumination, saveIllumination;

  std::filesystem::path reference, convergence, stats;  ///< empty: not wanted

  std::optional<std::pair<int, int>> record;         ///< the pixel whose record is drawn
  std::filesystem::path recordImage = "record.png";  ///< into this file

  /// Throws UsageError that names the option.
  void validate() const;
};

/// The command that makes the caches a job needs, for messages.
std::string lobefitCommand(const RenderJob& job);

/// Reads, trains, renders and writes all outputs; talk goes to stderr. Throws std::runtime_error.
void run(const RenderJob& job);

}  // namespace lobe
