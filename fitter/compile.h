#pragma once
// The compile driver: from the lobes of a scene's materials to cache files that are up to date.

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "materials/lobe.h"
#include "runtime/mixture/grid.h"
#include "scenes/scene.h"
#include "schema/lobe_cache.h"

namespace lobe {

struct CompileOptions {
  std::filesystem::path directory = "lobes";
  FitSettings settings;
  int elevations = 64;   ///< records of an isotropic lobe
  int directions = 512;  ///< records of an anisotropic lobe
  bool force = false;    ///< fit what is up to date again

  /// Throws std::runtime_error that names the option.
  void validate() const;
};

/// A lobe and all materials that have it.
struct LobeUse {
  LobePtr lobe;
  std::vector<std::string> materials;
};

/// The lobes of a scene, equal ones (by key) once, in the order of the materials.
std::vector<LobeUse> collectLobes(const Scene& scene);

/// One cache file to be had.
struct CompileJob {
  LobeUse use;
  DirectionGrid grid;
  LobeCacheInfo info;
  std::filesystem::path path;
  bool upToDate = false;
  std::string stale;  ///< why a file that is there will not do
};

/// Looks at what is there: a file is up to date when it opens and its key, model revision, settings and grid are those
/// asked for.
std::vector<CompileJob> planCompile(const std::vector<LobeUse>& uses, const CompileOptions& options);

/// Fits every record of the job on all cores and writes the file (its folder is made); advance is called for every
/// record, from any thread. The file's bytes do not depend on the number of threads. Throws std::runtime_error.
void runCompile(const CompileJob& job, const std::function<void()>& advance);

/// The fit of every record of a grid, as runCompile writes it.
struct FittedGrid {
  std::vector<CacheRecord> records;
  std::vector<CacheComponent> components;
  std::vector<CacheLookup> lookup;  ///< of every entry of the grid
};
FittedGrid fitGrid(const Lobe& lobe, const DirectionGrid& grid, const FitSettings& settings,
                   const std::function<void()>& advance = {});

}  // namespace lobe
