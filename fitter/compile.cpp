#include "fitter/compile.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <tbb/task.h>

#include "fitter/adaptive_fit.h"
#include "fitter/cache_mixture.h"
#include "fitter/lobe_fit.h"
#include "runtime/core/atomic_file.h"
#include "runtime/core/files.h"
#include "runtime/core/parallel.h"
#include "runtime/mixture/lookup.h"

namespace lobe {
namespace {

constexpr int kMaxRecords = 1 << 20;
constexpr std::uint32_t kMinSamples = 16;

void require(bool condition, const char* option, const std::string& range) {
  if (!condition) throw std::runtime_error(fmt::format("{} must be {}", option, range));
}

DirectionGrid gridFor(const Lobe& lobe, const CompileOptions& options) {
  const int directions = options.settings.method == FitMethod::automatic ? kAutoDirections : kDirections;
  if (lobe.kind() == LobeKind::isotropic) return {GridKind::elevation, options.elevations.value_or(kElevations)};
  return {GridKind::fibonacci, options.directions.value_or(directions)};
}

/// All settings that the fit depends on, as stored in the file.
FitSettings settingsFor(const Lobe& lobe, const CompileOptions& options) {
  FitSettings settings = options.settings;
  settings.revision = kFitRevision;
  const bool pinned =
      lobe.kind() == LobeKind::isotropic ? options.elevations.has_value() : options.directions.has_value();
  settings.fixedGrid = pinned || settings.method != FitMethod::automatic;
  if (settings.method == FitMethod::automatic)
    settings.reduction = 0;
  else
    settings.quality = 0;
  return settings;
}

LobeCacheInfo infoFor(const Lobe& lobe, const DirectionGrid& grid, const FitSettings& settings) {
  LobeCacheInfo info;
  info.toolVersion = LOBE_VERSION;
  info.model = lobe.model();
  info.key = lobe.key();
  info.summary = lobe.summary();
  info.modelRevision = lobe.revision();
  info.settings = settings;
  info.gridKind = static_cast<std::uint8_t>(grid.kind);
  info.gridCount = static_cast<std::uint32_t>(grid.count);
  return info;
}

/// Why a cache with the header `have` cannot be used for `want`; empty if it can. The tool's version does not matter,
/// since changes that affect a fit increase a revision.
std::string difference(const LobeCacheInfo& have, const LobeCacheInfo& want, const Lobe& lobe) {
  if (have.key != want.key) return "it was fitted for a different lobe";
  if (have.quarter && !lobe.mirrorSymmetric()) return "it was fitted for a mirror-symmetric lobe";
  if (have.modelRevision != want.modelRevision) return "the model's code has changed";
  if (have.settings.revision != want.settings.revision) return "the fitting code has changed";
  if (have.settings != want.settings) return "different fit settings";
  if (have.gridKind != want.gridKind || have.gridCount != want.gridCount) return "different grid of directions";
  return {};
}

void checkContent(CompileJob& job, FileContent content) {
  try {
    const LobeCache cache(std::move(content), job.path);
    job.stale = difference(cache.info(), job.info, *job.use.lobe);
    job.upToDate = job.stale.empty();
  } catch (const NewerFormat& e) {
    job.fault = e.what();
  } catch (const std::runtime_error& e) {
    job.stale = e.what();
  }
}

void check(CompileJob& job, bool force) {
  std::error_code error;  // of names that the system refuses, which writing reports, as it does for folders
  if (!std::filesystem::is_regular_file(job.path, error)) return;
  if (force) {
    job.stale = "--force";
    return;
  }
  std::optional<FileContent> content;
  try {
    content.emplace(job.path);
  } catch (const std::runtime_error& e) {
    job.fault = e.what();
    return;
  }
  checkContent(job, std::move(*content));
}

void makeFolder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw std::runtime_error(fmt::format("{}: cannot create folder: {}", folder.string(), error.message()));
}

// ---- Chains: sequences of neighbouring directions, each fitted from the previous one. They do not depend on the
// number of threads, so the content of the file does not either.

constexpr int kChainLength = 8;
// A fit that starts from a neighbour and is worse than the neighbour by more than this is also tried from scratch.
constexpr float kWorseByFactor = 1.5f, kWorseBy = 0.005f;

/// Index distance of neighbouring grid entries. For Fibonacci points it is a Fibonacci number near the square root of
/// their number, which gives a close neighbour everywhere except at the pole.
int neighbourStride(const DirectionGrid& grid) {
  if (grid.kind == GridKind::elevation) return 1;
  int a = 1, b = 1;
  while ((a + b) * (a + b) <= 2 * grid.count) b = std::exchange(a, a + b);
  return a;
}

std::vector<std::vector<int>> chainsOf(const DirectionGrid& grid, const FitSettings& settings) {
  const int stride = neighbourStride(grid), length = settings.method == FitMethod::wem ? 1 : kChainLength;
  std::vector<std::vector<int>> chains;
  for (int first = 0; first < grid.count; first += stride * length) {
    for (int i = first; i < std::min(first + stride, grid.count); ++i) {
      std::vector<int>& chain = chains.emplace_back();
      for (int j = i; j < std::min(first + stride * length, grid.count); j += stride) chain.push_back(j);
    }
  }
  return chains;
}

/// Least squares for the product may end in a worse optimum than converged weighted EM. In that case it is restarted
/// from the result of weighted EM, so the returned fit is never worse than that.
FittedRecord notAboveWeightedEm(const DirectionFitter& fitter, const FitSettings& settings, FittedRecord found) {
  if (settings.method != FitMethod::ceres) return found;
  FitSettings wem = settings;
  wem.method = FitMethod::wem;
  const FittedRecord reached = fitter.fit(wem);
  return found.largerVariance() <= reached.largerVariance() ? found : fitter.fit(settings, reached.mixture);
}

/// A record of a chain, with Gaussians, and the direction it was fitted for.
struct Neighbour {
  const FittedRecord& fitted;
  Vec3 wo;
};

FittedRecord fitFromNeighbour(const DirectionFitter& fitter, const Vec3& wo, GridKind kind, const Neighbour& neighbour,
                              const FitSettings& settings) {
  Mixture start(neighbour.fitted.mixture.size());
  alignMixture({kind, toDisc(neighbour.wo), {}}, neighbour.fitted.mixture, wo, start);
  FittedRecord record = fitter.fit(settings, start);
  if (record.record.nevCoverage <= kWorseByFactor * neighbour.fitted.record.nevCoverage + kWorseBy) return record;
  FittedRecord fresh = fitter.fit(settings);
  return fresh.largerVariance() < record.largerVariance() ? fresh : record;
}

FittedRecord fitOfChain(const Lobe& lobe, const Vec3& wo, GridKind kind, const std::optional<Neighbour>& neighbour,
                        const FitSettings& settings) {
  // The number of components is chosen for each record separately.
  if (settings.method == FitMethod::automatic) return fitWithFewest(lobe, wo, settings);
  const DirectionFitter fitter(lobe, wo, settings.samples);
  return notAboveWeightedEm(
      fitter, settings, neighbour ? fitFromNeighbour(fitter, wo, kind, *neighbour, settings) : fitter.fit(settings));
}

/// A lobe may be too narrow for some directions only, such as grazing ones, and is left to BSDF sampling there.
FittedRecord fitIfNotTooNarrow(const Lobe& lobe, const Vec3& wo, GridKind kind,
                               const std::optional<Neighbour>& neighbour, const FitSettings& settings) {
  try {
    return fitOfChain(lobe, wo, kind, neighbour, settings);
  } catch (const TooNarrow&) {
    return withoutComponents(lobe, wo, settings.samples);
  }
}

void fitChain(const Lobe& lobe, const DirectionGrid& grid, const std::vector<int>& chain, const FitSettings& settings,
              std::vector<FittedRecord>& fitted, const std::function<void()>& advance) {
  std::optional<Neighbour> neighbour;
  for (const int entry : chain) {
    throwIfCancelled();
    const Vec3 wo = grid.direction(entry);
    FittedRecord& record = fitted[static_cast<std::size_t>(entry)];
    record = fitIfNotTooNarrow(lobe, wo, grid.kind, neighbour, settings);
    neighbour.reset();
    if (!record.mixture.empty()) neighbour.emplace(Neighbour{record, wo});
    if (advance) advance();
  }
}

FittedGrid fitEveryEntry(const Lobe& lobe, const DirectionGrid& grid, const FitSettings& settings,
                         const std::function<void()>& advance) {
  std::vector<FittedRecord> fitted(static_cast<std::size_t>(grid.count));
  const std::vector<std::vector<int>> chains = chainsOf(grid, settings);
  parallelFor(std::size_t{0}, chains.size(),
              [&](std::size_t c) { fitChain(lobe, grid, chains[c], settings, fitted, advance); });
  FittedGrid result;
  for (std::uint32_t i = 0; i < fitted.size(); ++i) {
    result.append(fitted[i], i);
    result.lookup.push_back(i);
  }
  return result;
}

/// The result for a black lobe: one record without components, so the lobe is sampled by the BSDF only.
FittedGrid withoutFit(const DirectionGrid& grid) {
  FittedGrid result;
  result.append({{}, {}}, 0);
  result.lookup.assign(static_cast<std::size_t>(grid.count), 0);
  return result;
}

}  // namespace

FitSettings defaultFitSettings() {
  FitSettings settings;
  settings.method = FitMethod::automatic;
  settings.quality = kDefaultQuality;
  return settings;
}

void CompileOptions::validate() const {
  require(!directory.empty(), "--output", "the name of a folder");
  require(settings.components >= 1 && settings.components <= kMaxCacheComponents, "--components",
          fmt::format("from 1 to {}", kMaxCacheComponents));
  require(settings.samples >= kMinSamples && settings.samples <= kMaxFitSamples, "--samples",
          fmt::format("from {} to {}", kMinSamples, kMaxFitSamples));
  require(settings.reduction >= 0 && std::isfinite(settings.reduction), "--reduction", "0 or more");
  require(settings.quality > 0 && std::isfinite(settings.quality), "--quality", "greater than 0");
  for (const auto& [count, option] : {std::pair{elevations, "--elevations"}, std::pair{directions, "--directions"}})
    require(!count || (*count >= 1 && *count <= kMaxRecords), option, fmt::format("from 1 to {}", kMaxRecords));
}

std::vector<CompileJob> planCompile(const std::vector<LobeUse>& uses, const CompileOptions& options) {
  std::vector<CompileJob> jobs;
  for (const LobeUse& use : uses) {
    const DirectionGrid grid = gridFor(*use.lobe, options);
    CompileJob job{use, grid, infoFor(*use.lobe, grid, settingsFor(*use.lobe, options)), {}, false, {}, {}};
    job.path = options.directory / lobeFileName(use.lobe->model(), use.lobe->key());
    check(job, options.force);
    jobs.push_back(std::move(job));
  }
  return jobs;
}

FittedGrid fitGrid(const Lobe& lobe, const DirectionGrid& grid, const FitSettings& settings,
                   const std::function<void()>& advance) {
  FittedGrid result =
      settings.fixedGrid ? fitEveryEntry(lobe, grid, settings, advance) : fitAdaptively(lobe, grid, settings, advance);
  const bool black = std::ranges::none_of(result.records, [](const CacheRecord& r) { return r.integral > 0; });
  return black ? withoutFit(grid) : result;
}

int workOf(const CompileJob& job) {
  return job.info.settings.fixedGrid ? job.grid.count : adaptiveDirections(*job.use.lobe, job.grid);
}

FittedGrid fitForFile(const CompileJob& job, const std::function<void()>& advance) {
  if (!job.fault.empty()) throw std::runtime_error(job.fault);
  makeFolder(job.path.parent_path());
  checkWritable(job.path);
  return fitGrid(*job.use.lobe, job.grid, job.info.settings, advance);
}

void writeCompiled(const CompileJob& job, const FittedGrid& fit) {
  LobeCacheInfo info = job.info;
  info.quarter = fit.quarter;
  const std::vector<std::byte> bytes =
      nameErrors(job.path, [&] { return encodeLobeCache(info, fit.records, fit.components, fit.lookup); });
  writeAtomically(job.path, std::span<const std::byte>(bytes));
}

void runCompile(const CompileJob& job, const std::function<void()>& advance) {
  writeCompiled(job, fitForFile(job, advance));
}

}  // namespace lobe
