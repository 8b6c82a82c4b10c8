#pragma once
// Conversion of the state of a render to and from checkpoint files.

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "runtime/render/film/film.h"
#include "runtime/render/integrators/renderer.h"
#include "runtime/render/training/training.h"
#include "schema/checkpoint_file.h"

namespace lobe {

/// Names and values of everything that determines a picture, in the order in which differences are reported.
using RunSettings = std::vector<std::pair<std::string, std::string>>;

/// Throws std::runtime_error that names the first setting that differs.
void checkSameRun(const CheckpointFile& file, const std::filesystem::path& path, const RunSettings& settings);

/// The bytes of a checkpoint. illumination, importance: the content of .illum files; empty if the integrator uses none.
std::vector<std::byte> encodeCheckpoint(const RunSettings& settings, const Film& film, const RenderResult& result,
                                        const TrainingReport& training, std::span<const std::byte> illumination,
                                        std::span<const std::byte> importance);

Film filmOf(const CheckpointFile& file);
/// Throws std::runtime_error if the file does not have the counters of this version.
RenderResult resultOf(const CheckpointFile& file, const std::filesystem::path& path);
TrainingReport trainingOf(const CheckpointFile& file);

}  // namespace lobe
