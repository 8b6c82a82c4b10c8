#pragma once
// Stores and restores trained illumination, so that it can be reused for other cameras and on other machines.

#include <filesystem>

#include "runtime/render/training/training.h"
#include "schema/illumination_file.h"

namespace lobe {

/// The content of an .illum file with the illumination that training with the plan produced. sceneFile gives the name
/// of the scene in the file. The same training produces the same bytes.
std::vector<std::byte> encodeIllumination(const TrainedIllumination& trained, const TrainingPlan& plan,
                                          const Scene& scene, const std::filesystem::path& sceneFile);

/// Restores saved illumination for rendering the scene. Throws std::runtime_error that names the path if the file was
/// trained for another scene. The report has no passes and a training time of 0.
TrainedIllumination restoreIllumination(const IlluminationFile& file, const std::filesystem::path& path,
                                        const Scene& scene);

}  // namespace lobe
