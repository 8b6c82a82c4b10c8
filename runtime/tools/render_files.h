#pragma once
// The files that a run of loberender reads and writes.

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "runtime/tools/render_job.h"
#include "scenes/scene.h"

namespace lobe {

/// Checks before the work starts that all output files can be written and are distinct from each other and from the
/// inputs. The checkpoint that a run continues may be replaced by its own. Throws UsageError or std::runtime_error.
void checkFiles(const RenderJob& job);

/// Throws UsageError if an output would replace a file of the scene or a BRDF cache.
void checkSceneFiles(const RenderJob& job, const Scene& scene);

/// Collects the errors of outputs, so that one that fails does not prevent the others.
class OutputErrors {
 public:
  /// Calls `write`; if it throws, its message is added to the errors.
  void attempt(const std::filesystem::path& path, const std::function<void()>& write);
  const std::vector<std::string>& all() const { return errors_; }

 private:
  std::vector<std::string> errors_;
};

}  // namespace lobe
