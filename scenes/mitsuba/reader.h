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
  /// Values for $name, over the file's <default>s.
  std::map<std::string, std::string> definitions;
  /// Leave out or replace what is at fault and warn (once per kind) instead of failing.
  bool lenient = false;
  /// false: materials only, no meshes or environment (the fitter's need).
  bool geometry = true;
  /// Told the share of the meshes just read; from any thread.
  std::function<void(double)> onProgress = {};
};

/// Reads the whole file before it throws SceneError with all faults found; with options.lenient only when nothing is
/// left to draw. Meshes are read in parallel with oneTBB.
Scene readScene(const std::filesystem::path& path, const ReadOptions& options = {});

/// What readScene finds in a file.
struct SceneCheck {
  std::vector<Fault> faults;  ///< also those that options.lenient gets past
  std::vector<std::string> warnings, notes;
  bool readable = false;  ///< readScene with the same options does not throw
};

/// Reads as readScene does, and returns all that it finds. Throws only what is not the file's fault.
SceneCheck checkScene(const std::filesystem::path& path, const ReadOptions& options = {});

}  // namespace lobe
