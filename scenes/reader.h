#pragma once
// Reads Mitsuba scene files (0.4 to 3.x spellings) into plain data.

#include <filesystem>
#include <functional>
#include <map>
#include <stdexcept>
#include <string>

#include "scenes/scene.h"

namespace lobe {

/// A fault in a scene file; what() is one line, "FILE:LINE:COLUMN: message", and says what is known or expected
/// instead.
class SceneError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct ReadOptions {
  /// Values for $name, over the file's <default>s.
  std::map<std::string, std::string> definitions;
  /// Replace what is not known by something plain and warn (once per kind) instead of failing.
  bool lenient = false;
  /// false: materials only, no meshes or environment (the fitter's need).
  bool geometry = true;
  /// Told the share of the meshes just read; from any thread.
  std::function<void(double)> onProgress = {};
};

/// Throws SceneError. Meshes are read in parallel with oneTBB.
Scene readScene(const std::filesystem::path& path, const ReadOptions& options = {});

}  // namespace lobe
