#pragma once
// Trained illumination kept in a file, so that one training serves other frames of a still scene and other machines.

#include <filesystem>

#include "runtime/render/training/training.h"
#include "schema/illumination_file.h"

namespace lobe {

/// Writes what training with the plan has learnt about the scene. sceneFile: where the scene is, for its name. The same
/// training gives the same bytes. Throws std::runtime_error that names the path.
void saveIllumination(const std::filesystem::path& path, const TrainedIllumination& trained, const TrainingPlan& plan,
                      const Scene& scene, const std::filesystem::path& sceneFile);

/// What was saved, for rendering the scene. Throws std::runtime_error that names the path when the file was trained for
/// another one. The report has no passes and no seconds: nothing was trained now.
TrainedIllumination restoreIllumination(const IlluminationFile& file, const std::filesystem::path& path,
                                        const Scene& scene);

}  // namespace lobe
