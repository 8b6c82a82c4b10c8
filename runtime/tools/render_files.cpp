#include "runtime/tools/render_files.h"

#include <map>
#include <vector>

#include <fmt/format.h>

#include "runtime/core/atomic_file.h"
#include "runtime/guiding/brdf_caches.h"
#include "runtime/tools/tool.h"

namespace lobe {
namespace {

/// The canonical absolute path, for comparing paths.
std::filesystem::path placeOf(const std::filesystem::path& path) {
  return std::filesystem::weakly_canonical(std::filesystem::absolute(path));
}

std::vector<std::filesystem::path> writtenBy(const RenderJob& job) {
  std::vector<std::filesystem::path> written = job.outputs;
  for (const auto& path : {job.convergence, job.stats, job.saveIllumination, job.checkpoint})
    if (!path.empty()) written.push_back(path);
  if (job.record) written.push_back(job.recordImage);
  return written;
}

}  // namespace

void checkFiles(const RenderJob& job) {
  const std::vector<std::filesystem::path> written = writtenBy(job);
  std::map<std::filesystem::path, int> uses;
  for (const auto& path : {job.scene, job.camera, job.reference, job.illumination})
    if (!path.empty()) ++uses[placeOf(path)];
  if (!job.resume.empty() && (job.checkpoint.empty() || placeOf(job.resume) != placeOf(job.checkpoint)))
    ++uses[placeOf(job.resume)];
  for (const auto& path : written)
    if (++uses[placeOf(path)] > 1)
      throw UsageError(fmt::format("{}: is used for more than one file, and would be overwritten", path.string()));
  for (const auto& path : written) checkWritable(path);
}

void checkSceneFiles(const RenderJob& job, const Scene& scene) {
  std::vector<std::filesystem::path> read = scene.files;
  if (job.mayUseProduct())
    for (const LobeRequest& request : lobeRequests(scene))
      read.push_back(job.cacheFolder / lobeFileName(request.model, request.key));
  for (const auto& path : writtenBy(job)) checkNotRead(path, read);
}

}  // namespace lobe
