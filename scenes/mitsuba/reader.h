#pragma once
// Reads Mitsuba scene files (0.4 to 3.x spellings) into plain data.

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "scenes/mitsuba/findings.h"
#include "scenes/scene.h"

namespace lobe {

struct ReadOptions {
  /// Values for $name, which override the file's <default>s.
  std::map<std::string, std::string> definitions;
  /// Leave out or replace faulty parts with a warning (once per kind) instead of failing.
  bool lenient = false;
  /// false: read only materials, no meshes or environment, as the fitter needs.
  bool geometry = true;
  /// Called from any thread after each mesh, with the fraction of all meshes that it is (increments that sum to 1).
  std::function<void(double)> onProgress = {};
  /// Another scene file, whose first sensor with its film is read in place of that of the scene; empty: none. Nothing
  /// else of it is used. The definitions are for both files, and each must be used by one of them.
  std::filesystem::path camera = {};
};

/// Reads the whole file, then throws SceneError with all faults found; with options.lenient, only if nothing is left to
/// draw or there is no camera. Meshes are read in parallel with oneTBB. Throws LoopCancelled soon after a task in which
/// this runs has been cancelled.
Scene readScene(const std::filesystem::path& path, const ReadOptions& options = {});

/// What readScene finds in a file.
struct SceneCheck {
  std::vector<Fault> faults;  ///< including those that options.lenient tolerates
  std::vector<std::string> warnings, notes;
  bool readable = false;  ///< readScene with the same options does not throw
};

/// Reads the file like readScene and returns everything that it finds. Throws only exceptions that are not caused by
/// the file.
SceneCheck checkScene(const std::filesystem::path& path, const ReadOptions& options = {});

}  // namespace lobe
