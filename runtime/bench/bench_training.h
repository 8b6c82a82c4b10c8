#pragma once
// The scene, training plan and command-line options that the benchmarks of training share.

#include <string>
#include <vector>

#include "runtime/render/training/training.h"
#include "runtime/tools/tool.h"
#include "scenes/mitsuba/reader.h"

namespace lobe {

struct BenchTraining {
  std::string scene;
  ReadOptions read;
  int width = 350;  ///< of the image, in pixels
  int threads = 0;  ///< 0: all cores
  TrainingPlan plan;

  /// Declares all options except those for the source of samples and the number of passes, which each benchmark
  /// declares itself.
  void declare(CLI::App& app);
  /// The scene with its image resized to `width`, with the same aspect ratio.
  Scene readScene() const;
};

}  // namespace lobe
