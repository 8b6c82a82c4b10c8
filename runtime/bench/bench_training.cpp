#include "runtime/bench/bench_training.h"

#include <algorithm>
#include <cmath>

#include <CLI/CLI.hpp>

#include "scenes/camera.h"

namespace lobe {

void BenchTraining::declare(CLI::App& app) {
  app.add_option("scene", scene, "Mitsuba scene file (XML)")->required();
  app.add_option("--width", width, "Width of the image in pixels; the aspect ratio is kept")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--photons", plan.photons, "Number of photons per pass")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--importons", plan.importons, "Number of importons per pass")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--components", plan.records.components, "Gaussians per record, 1 to 8")
      ->check(CLI::Range(1, FieldOptions::kMostComponents))
      ->capture_default_str();
  app.add_option("--seed", plan.seed, "Random seed of the training")->capture_default_str();
  app.add_flag("--lenient", read.lenient, "Replace or leave out faulty parts of the scene, with warnings");
  addDefinitions(app, read.definitions);
  addThreads(app, threads);
}

Scene BenchTraining::readScene() const {
  Scene made = lobe::readScene(scene, read);
  const double aspect = static_cast<double>(made.camera.height) / made.camera.width;
  made.camera.crop.reset();
  made.camera.width = width;
  made.camera.height = std::max(1, static_cast<int>(std::lround(width * aspect)));
  made.camera.horizontalFov = horizontalFov(made.camera, made.camera.width, made.camera.height);
  return made;
}

}  // namespace lobe
