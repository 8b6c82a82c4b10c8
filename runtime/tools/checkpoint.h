#pragma once
// Conversion of the state of a render to and from checkpoint files.

#include <cstddef>
#include <filesystem>
#include <span>
#include <vector>

#include "runtime/render/film/film.h"
#include "runtime/render/integrators/renderer.h"
#include "runtime/render/training/training.h"
#include "runtime/tools/render_setup.h"
#include "schema/checkpoint_file.h"

namespace lobe {

/// Throws std::runtime_error that names the first setting that differs.
void checkSameRun(const CheckpointFile& file, const std::filesystem::path& path, const RunSettings& settings);

/// The bytes of a checkpoint. illumination, importance: the content of .illum files; empty if the integrator uses none.
std::vector<std::byte> encodeCheckpoint(const RunSettings& settings, const Film& film, const RenderResult& result,
                                        const Guiding& guiding, std::span<const std::byte> illumination,
                                        std::span<const std::byte> importance);

Film filmOf(const CheckpointFile& file);
/// Throws std::runtime_error if the file does not have the counters of this version, or impossible ones.
RenderResult resultOf(const CheckpointFile& file, const std::filesystem::path& path);
TrainingReport trainingOf(const CheckpointFile& file);
/// Sets guiding.pilot and guiding.lightPaths, so that the run goes on with what it has chosen.
void restoreChoices(const CheckpointFile& file, Guiding& guiding);

}  // namespace lobe
