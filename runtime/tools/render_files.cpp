#include "runtime/tools/render_files.h"

#include <vector>

#include "runtime/core/atomic_file.h"
#include "runtime/guiding/brdf_caches.h"
#include "runtime/tools/tool.h"

namespace lobe {
namespace {

std::vector<std::filesystem::path> writtenBy(const RenderJob& job) {
  std::vector<std::filesystem::path> written = job.outputs;
  for (const auto& path : {job.convergence, job.stats, job.saveIllumination, job.checkpoint})
    if (!path.empty()) written.push_back(path);
  if (job.record) written.push_back(job.recordImage);
  return written;
}

/// The files that the options name.
std::vector<std::filesystem::path> readBy(const RenderJob& job) {
  std::vector<std::filesystem::path> read{job.scene, job.camera, job.reference, job.illumination};
  if (!job.resume.empty() && (job.checkpoint.empty() || !isSameFile(job.resume, job.checkpoint)))
    read.push_back(job.resume);
  return read;
}

}  // namespace

void checkFiles(const RenderJob& job) {
  const std::vector<std::filesystem::path> written = writtenBy(job);
  checkOutputs(written, readBy(job));
  OutputErrors errors;
  for (const auto& path : written) errors.attempt(path, [&] { checkWritable(path); });
  errors.throwIfAny();
}

void checkSceneFiles(const RenderJob& job, const Scene& scene) {
  std::vector<std::filesystem::path> read = scene.files;
  if (job.mayUseProduct())
    for (const LobeRequest& request : lobeRequests(scene))
      read.push_back(job.cacheFolder / lobeFileName(request.model, request.key));
  checkOutputs(writtenBy(job), read);
}

}  // namespace lobe
