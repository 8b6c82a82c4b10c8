#pragma once
// The files that a run of loberender reads and writes.

#include <filesystem>
#include "runtime/tools/render_job.h"
#include "scenes/scene.h"

namespace lobe {

/// Checks before the work starts that all output files are distinct from each other and from the inputs (UsageError),
/// and that they can be written (std::runtime_error with a line for each that cannot). The checkpoint that a run
/// continues may be replaced by its own.
void checkFiles(const RenderJob& job);

/// Throws UsageError if an output would replace a file of the scene or a BRDF cache.
void checkSceneFiles(const RenderJob& job, const Scene& scene);

}  // namespace lobe
