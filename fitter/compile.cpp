#include "fitter/compile.h"

#include <cmath>
#include <stdexcept>
#include <unordered_map>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "fitter/cache_mixture.h"
#include "fitter/lobe_fit.h"
#include "schema/atomic_file.h"

namespace lobe {
namespace {

constexpr int kMaxRecords = 1 << 20;
constexpr std::uint32_t kMinSamples = 16, kMaxSamples = 1 << 24;

void require(bool condition, const char* option, const std::string& range) {
  if (!condition) throw std::runtime_error(fmt::format("{} must be {}", option, range));
}

DirectionGrid gridFor(const Lobe& lobe, const CompileOptions& options) {
  if (lobe.kind() == LobeKind::isotropic) return {GridKind::elevation, options.elevations};
  if (lobe.kind() == LobeKind::anisotropic) return {GridKind::fibonacci, options.directions};
  throw std::runtime_error(fmt::format("lobe {} is constant or a mirror: neither can be fitted", lobe.summary()));
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

/// Why a cache that says `have` does not serve for `want`; empty when it does. The tool's version does not matter: what
/// changes a fit raises a revision.
std::string difference(const LobeCacheInfo& have, const LobeCacheInfo& want) {
  if (have.key != want.key) return "it is of another lobe";
  if (have.modelRevision != want.modelRevision) return "the model's code has changed";
  if (have.settings.revision != want.settings.revision) return "the fit's code has changed";
  if (have.settings != want.settings) return "other fit settings";
  if (have.gridKind != want.gridKind || have.gridCount != want.gridCount) return "another grid of directions";
  return {};
}

void check(CompileJob& job, bool force) {
  if (!std::filesystem::exists(job.path)) return;
  try {
    job.stale = force ? "--force" : difference(LobeCache::open(job.path).info(), job.info);
    job.upToDate = job.stale.empty();
  } catch (const std::runtime_error& e) {
    job.stale = e.what();
  }
}

void makeFolder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw std::runtime_error(fmt::format("{}: cannot make the folder: {}", folder.string(), error.message()));
}

}  // namespace

void CompileOptions::validate() const {
  require(!directory.empty(), "--output", "the name of a folder");
  require(settings.components >= 1 && settings.components <= kMaxCacheComponents, "--components",
          fmt::format("from 1 to {}", kMaxCacheComponents));
  require(settings.samples >= kMinSamples && settings.samples <= kMaxSamples, "--samples",
          fmt::format("from {} to {}", kMinSamples, kMaxSamples));
  require(settings.reduction >= 0 && std::isfinite(settings.reduction), "--reduction", "0 or more");
  require(elevations >= 1 && elevations <= kMaxRecords, "--elevations", fmt::format("from 1 to {}", kMaxRecords));
  require(directions >= 1 && directions <= kMaxRecords, "--directions", fmt::format("from 1 to {}", kMaxRecords));
}

std::vector<LobeUse> collectLobes(const Scene& scene) {
  std::vector<LobeUse> uses;
  std::unordered_map<std::string, std::size_t> known;
  for (const Material& material : scene.materials) {
    for (const LobePtr& lobe : material.bsdf->lobes()) {
      const auto [entry, isNew] = known.try_emplace(lobe->key(), uses.size());
      if (isNew) uses.push_back({lobe, {}});
      std::vector<std::string>& names = uses[entry->second].materials;
      // Both sides of a two-sided material may have the same lobe.
      if (names.empty() || names.back() != material.name) names.push_back(material.name);
    }
  }
  return uses;
}

std::vector<CompileJob> planCompile(const std::vector<LobeUse>& uses, const CompileOptions& options) {
  FitSettings settings = options.settings;
  settings.revision = kFitRevision;
  std::vector<CompileJob> jobs;
  for (const LobeUse& use : uses) {
    const DirectionGrid grid = gridFor(*use.lobe, options);
    CompileJob job{use, grid, infoFor(*use.lobe, grid, settings), {}, false, {}};
    job.path = options.directory / lobeFileName(use.lobe->model(), use.lobe->key());
    check(job, options.force);
    jobs.push_back(std::move(job));
  }
  return jobs;
}

FittedGrid fitGrid(const Lobe& lobe, const DirectionGrid& grid, const FitSettings& settings,
                   const std::function<void()>& advance) {
  std::vector<FittedRecord> fitted(static_cast<std::size_t>(grid.count));
  tbb::parallel_for(0, grid.count, [&](int i) {
    fitted[static_cast<std::size_t>(i)] = fitLobe(lobe, grid.direction(i), settings);
    if (advance) advance();
  });
  FittedGrid result;
  double integral = 0;
  for (FittedRecord& f : fitted) {
    f.record.first = static_cast<std::uint32_t>(result.components.size());
    result.records.push_back(f.record);
    for (const Gaussian& g : f.mixture) result.components.push_back(asComponent(g));
    integral += f.record.integral;
  }
  if (!(integral > 0))
    throw std::runtime_error(fmt::format("lobe {} cannot be fitted: none of its samples has a value", lobe.summary()));
  return result;
}

void runCompile(const CompileJob& job, const std::function<void()>& advance) {
  const FittedGrid fit = fitGrid(*job.use.lobe, job.grid, job.info.settings, advance);
  makeFolder(job.path.parent_path());
  writeAtomically(job.path, encodeLobeCache(job.info, fit.records, fit.components));
}

}  // namespace lobe
