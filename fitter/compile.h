#pragma once
// The compile driver: from lobes to cache files that are up to date.

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "fitter/fitted_grid.h"
#include "materials/lobe.h"
#include "runtime/mixture/grid.h"
#include "schema/lobe_cache.h"

namespace lobe {

/// Method auto with the quality that charts of quality against time and size recommend.
FitSettings defaultFitSettings();

/// The grids where no option says otherwise. With method auto few directions need a record of their own, and of
/// symmetric lobes only a quarter is looked at, so that the grid of anisotropic lobes may be finer.
inline constexpr int kElevations = 64, kDirections = 512, kAutoDirections = 2048;

struct CompileOptions {
  std::filesystem::path directory = "lobes";
  FitSettings settings = defaultFitSettings();
  std::optional<int> elevations;  ///< records of every isotropic lobe, whether it needs them or not
  std::optional<int> directions;  ///< the same of anisotropic lobes
  bool force = false;             ///< fit what is up to date again

  /// Throws std::runtime_error that names the option.
  void validate() const;
};

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

/// The number of calls of advance in runCompile.
int workOf(const CompileJob& job);

/// Fits every record of the job on all cores and writes the file (its folder is made); advance is called for every
/// direction looked at, from any thread. The file's bytes do not depend on the number of threads. Throws
/// std::runtime_error.
void runCompile(const CompileJob& job, const std::function<void()>& advance);

/// The fit of a lobe over a grid, as runCompile writes it. Throws std::runtime_error, also when nothing is reflected
/// from any direction.
FittedGrid fitGrid(const Lobe& lobe, const DirectionGrid& grid, const FitSettings& settings,
                   const std::function<void()>& advance = {});

}  // namespace lobe
