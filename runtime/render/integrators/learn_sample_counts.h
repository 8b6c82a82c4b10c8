#pragma once
// Traces the paths from which SampleCountModel learns.

#include "runtime/render/film/camera.h"
#include "runtime/render/integrators/guided_integrator.h"

namespace lobe {

/// Learns the counts for paths that a guide samples, from `paths` paths through random pixels, > 0. options: of the
/// paths; their counts are ignored. records: number of records of the guide's field. The result does not depend on the
/// number of threads.
SampleCountModel learnSampleCounts(const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                                   const GuidedSampler& guide, std::size_t records, int paths, std::uint64_t seed);

}  // namespace lobe
