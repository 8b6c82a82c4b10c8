#pragma once
// A run of loberender, from the options to the output files.

#include "runtime/core/stop_flag.h"
#include "runtime/tools/render_job.h"

namespace lobe {

/// Reads the scene, trains, renders and writes all outputs; diagnostics go to stderr. An output that cannot be written
/// does not prevent the others from being written. Throws std::runtime_error. If stop is set, ends early and throws
/// Stopped: in training, nothing is written; in rendering, the outputs show the samples so far.
void run(const RenderJob& job, const StopFlag& stop);

}  // namespace lobe
