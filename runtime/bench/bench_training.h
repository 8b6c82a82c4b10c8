#pragma once
// What the benchmarks of training and of its use have in common: a scene, how it is trained, and what their options are
// called.

#include <string>
#include <vector>

#include "runtime/render/training/training.h"
#include "runtime/tools/tool.h"
#include "scenes/mitsuba/reader.h"

namespace lobe {

struct BenchTraining {
  std::string scene;
  ReadOptions read;
  int width = 350;  ///< of the picture, in pixels
  int threads = 0;  ///< 0: all cores
  TrainingPlan plan;

  /// All but what records learn from and the number of passes, which each benchmark names itself.
  void declare(CLI::App& app);
  /// The scene with its picture made that wide, in its own shape.
  Scene readScene() const;
};

}  // namespace lobe
