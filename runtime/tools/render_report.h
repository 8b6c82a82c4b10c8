#pragma once
// What a run of loberender reports: statistics, the attributes of the picture, and the error against time.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "runtime/image/image.h"
#include "runtime/image/image_output.h"
#include "runtime/render/film/film.h"
#include "runtime/tools/render_job.h"
#include "runtime/tools/render_setup.h"
#include "scenes/scene.h"

namespace lobe {

/// Times of the steps before training, in seconds.
struct LoadTimes {
  double reading = 0;    ///< reading the scene file, its meshes and images
  double building = 0;   ///< building the acceleration structure and the light tables
  double embree = 0;     ///< the part of `building` spent in Embree
  double restoring = 0;  ///< restoring the illumination from its file
};

/// Results of a run, or of the part so far.
struct RunResult {
  RenderResult render;
  const Guiding& guiding;
  const Film& film;

  const TrainingReport& training() const { return guiding.training.report; }
  IntegratorKind integrator(const RenderJob& job) const {
    if (!guiding.pilot) return job.integrator;
    return guiding.pilot->prefersProduct() ? IntegratorKind::product : IntegratorKind::path;
  }
  double seconds() const { return guiding.seconds() + render.total.seconds; }
};

/// The content of --stats. sceneHash: pictureHash of the scene.
nlohmann::ordered_json statistics(const RenderJob& job, std::uint64_t sceneHash, const LoadTimes& load,
                                  const RunResult& run);

/// The attributes of the picture. The same for every run with the same options, except with --seconds.
ImageAttributes attributes(const RenderJob& job, std::uint64_t sceneHash, const RunResult& run);

/// The error against time, for --convergence: one line for each call of add. Does nothing without a reference.
class ConvergenceLog {
 public:
  /// Throws std::runtime_error if the reference cannot be read or has another size than the picture.
  ConvergenceLog(const RenderJob& job, const Scene& scene);

  void add(const Image& picture, double seconds, int samples);
  bool isActive() const { return reference_.has_value(); }
  /// Throws std::runtime_error.
  void write() const;

 private:
  std::filesystem::path file_;
  std::optional<Image> reference_;
  std::string text_;
};

}  // namespace lobe
