#pragma once
// The files that a run of loberender reads and writes.

#include <filesystem>
#include "runtime/tools/render_job.h"
#include "scenes/scene.h"

namespace lobe {

/// Checks before the work starts that all output files can be written and are distinct from each other and from the
/// inputs. The checkpoint that a run continues may be replaced by its own. Throws UsageError or std::runtime_error.
void checkFiles(const RenderJob& job);

/// Throws UsageError if an output would replace a file of the scene or a BRDF cache.
void checkSceneFiles(const RenderJob& job, const Scene& scene);

}  // namespace lobe
