#pragma once
// Compiles lobes into cache files and finds out which files are already up to date.

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

/// FitMethod::automatic with kDefaultQuality.
FitSettings defaultFitSettings();

/// Default grid sizes. FitMethod::automatic stores records for few of the directions and visits only a quarter of them
/// for symmetric lobes, so its grid for anisotropic lobes can be finer.
inline constexpr int kElevations = 64, kDirections = 512, kAutoDirections = 2048;

struct CompileOptions {
  std::filesystem::path directory = "lobes";
  FitSettings settings = defaultFitSettings();
  std::optional<int> elevations;  ///< grid size for isotropic lobes; fits a record for every direction
  std::optional<int> directions;  ///< the same for anisotropic lobes
  bool force = false;             ///< also fit lobes whose cache file is up to date

  /// Throws a std::runtime_error that names the invalid option.
  void validate() const;
};

/// One cache file that a scene needs.
struct CompileJob {
  LobeUse use;
  DirectionGrid grid;
  LobeCacheInfo info;
  std::filesystem::path path;
  bool upToDate = false;
  std::string stale;  ///< why an existing file cannot be used; empty otherwise
  std::string fault;  ///< why the file must not be replaced, although it cannot be used; empty otherwise
};

/// Checks which cache files exist and are up to date: a file is up to date if it can be opened and its key, model
/// revision, fit settings and grid are the requested ones. Damaged files and those of an older format are stale. Unless
/// options.force is set, a file of a newer format and one that the system does not let us read are faults instead,
/// because they may be up to date for others.
std::vector<CompileJob> planCompile(const std::vector<LobeUse>& uses, const CompileOptions& options);

/// The number of times that runCompile calls advance.
int workOf(const CompileJob& job);

/// Fits all records of the job on all cores and writes the file, creating its folder if necessary. advance is called
/// once per visited direction, from any thread. The content of the file does not depend on the number of threads.
/// Throws std::runtime_error, also if the job has a fault.
void runCompile(const CompileJob& job, const std::function<void()>& advance);

/// The two halves of runCompile: fits the records, after it has made sure that the file may be written, and writes it.
FittedGrid fitForFile(const CompileJob& job, const std::function<void()>& advance);
void writeCompiled(const CompileJob& job, const FittedGrid& fit);

/// Fits a lobe over a grid, as runCompile does. A lobe that reflects nothing from any direction gets one record without
/// Gaussians, and so do directions for which a lobe is too narrow. Throws std::runtime_error if the lobe returns
/// numbers that are not finite.
FittedGrid fitGrid(const Lobe& lobe, const DirectionGrid& grid, const FitSettings& settings,
                   const std::function<void()>& advance = {});

}  // namespace lobe
