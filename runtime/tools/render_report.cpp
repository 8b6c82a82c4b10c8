#include "runtime/tools/render_report.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/resource.h>

#include "runtime/core/atomic_file.h"
#include "runtime/image/error_metrics.h"
#include "scenes/camera.h"

namespace lobe {
namespace {

double peakResidentBytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

nlohmann::ordered_json asJson(const PassReport& pass) {
  return {{"seconds", pass.seconds},
          {"particles", pass.particles},
          {"particles_per_second", static_cast<double>(pass.particles) / pass.seconds},
          {"records", pass.records},
          {"log_likelihood", pass.logLikelihood ? nlohmann::ordered_json(*pass.logLikelihood) : nullptr}};
}

/// Each count divided by the sum of all counts, by name.
template <std::size_t size>
nlohmann::ordered_json fractionsOf(const std::array<std::uint64_t, size>& counts,
                                   const std::array<const char*, size>& names) {
  const double sum = std::accumulate(counts.begin(), counts.end(), 0.0);
  nlohmann::ordered_json fractions;
  for (std::size_t i = 0; i < size; ++i) fractions[names[i]] = sum > 0 ? static_cast<double>(counts[i]) / sum : 0.0;
  return fractions;
}

nlohmann::ordered_json asJson(const std::optional<Pilot>& pilot) {
  if (!pilot) return nullptr;
  const auto one = [](const PilotResult& result) {
    return nlohmann::ordered_json{{"variance", result.variance}, {"cost", result.cost}};
  };
  return {{"seconds", pilot->seconds}, {"path", one(pilot->path)}, {"product", one(pilot->product)}};
}

nlohmann::ordered_json asJson(const std::optional<LightPathTrial>& trial, bool used, double seconds) {
  if (!trial) return nullptr;
  return {{"used", used},
          {"seconds", seconds},
          {"paths_per_pixel", trial->pathsPerPixel},
          {"variance", trial->variance},
          {"second_moment", trial->secondMoment},
          {"second_moment_left", trial->secondMomentLeft},
          {"cost", trial->cost},
          {"cost_with_light_paths", trial->costWithLight}};
}

std::string hashText(std::uint64_t hash) {
  return fmt::format("{:016x}", hash);
}

/// In the order in which the scene first uses the caches.
nlohmann::ordered_json cacheHashes(const Guiding& guiding) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  if (guiding.caches)
    for (const std::uint64_t hash : guiding.caches->hashes()) list.push_back(hashText(hash));
  return list;
}

/// In descending order.
nlohmann::ordered_json asJson(const LargestContributions& largest) {
  std::vector<LargestContributions::Key> keys(largest.keys.begin(), largest.keys.end());
  std::erase(keys, LargestContributions::Key{0});
  std::ranges::sort(keys, std::greater<>());
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const LargestContributions::Key key : keys) {
    const PathKind kind = LargestContributions::kindOf(key);
    list.push_back({{"luminance", LargestContributions::luminanceOf(key)},
                    {"technique", kTechniqueNames[static_cast<std::size_t>(kind.technique)]},
                    {"segments", kind.segments},
                    {"delta_at_light", kind.deltaAtLight}});
  }
  return list;
}

/// Whether the statistics of paths are those of all samples of the picture. Those of samples that not all pixels have
/// may be missing, because a run that is resumed makes such samples again (renderer.cpp).
bool coverPicture(const RunResult& run) {
  const auto [least, most] = run.film.sampleRange();
  return least == most;
}

nlohmann::ordered_json meanPathLength(const PathStatistics& paths) {
  if (paths.paths == 0) return nullptr;
  return static_cast<double>(paths.segments) / static_cast<double>(paths.paths);
}

/// The light that --firefly-limit has cut off, as a fraction of the sum of the picture without the limit.
double cutFraction(const RenderJob& job, const RunResult& run) {
  const double cut = run.render.statistics.cut.times(*job.fireflyLimit);
  double sum = cut;
  for (const Film::Pixel& pixel : run.film.pixels())
    sum += luminance(Eigen::Map<const Eigen::Array3d>(pixel.sum).cast<float>());
  return sum > 0 ? cut / sum : 0;
}

}  // namespace

nlohmann::ordered_json statistics(const RenderJob& job, std::uint64_t sceneHash, const LoadTimes& load,
                                  const RunResult& run) {
  const PathStatistics& paths = run.render.statistics;
  const RenderProgress& total = run.render.total;
  const bool known = coverPicture(run);
  nlohmann::ordered_json passes = nlohmann::ordered_json::array();
  for (const PassReport& pass : run.training().passes) passes.push_back(asJson(pass));
  return {{"version", LOBE_VERSION},
          {"scene_hash", hashText(sceneHash)},
          {"cache_hashes", cacheHashes(run.guiding)},
          {"integrator", nameOf(run.integrator(job))},
          {"pilot", asJson(run.guiding.pilot)},
          {"light_paths", asJson(run.guiding.lightPaths, run.guiding.usesLightPaths, run.guiding.secondsLightPaths)},
          {"seed", job.seed},
          {"seconds_reading", load.reading},
          {"seconds_building", load.building},
          {"seconds_embree_build", load.embree},
          {"seconds_restoring_illumination", load.restoring},
          {"seconds_total", run.seconds()},
          {"seconds_learning_lights", run.guiding.secondsLights},
          {"seconds_training", run.training().seconds},
          {"seconds_sample_counts", run.guiding.secondsCounts},
          {"seconds_rendering", total.seconds},
          {"spp", total.samples},
          {"rays", paths.rays()},
          {"path_segments", paths.segments},
          {"segments_per_second", static_cast<double>(paths.segments) / total.seconds},
          {"mean_path_length", known ? meanPathLength(paths) : nullptr},
          {"peak_rss_bytes", peakResidentBytes()},
          {"training_passes", passes},
          {"training_particles", run.training().particles()},
          {"records", run.guiding.training.field.records()},
          {"records_undersampled_fraction", run.training().undersampledFraction},
          {"record_bytes_before_reduction", run.guiding.unreducedBytes},
          {"record_bytes", run.guiding.training.field.bytes()},
          {"record_components", run.guiding.training.field.meanComponents()},
          {"lobe_components", run.guiding.caches ? run.guiding.caches->meanComponents() : 0.0},
          {"lobe_bytes", run.guiding.caches ? run.guiding.caches->bytes() : 0},
          {"strategy_fractions", fractionsOf(paths.strategies, kScatteringNames)},
          {"guiding_decisions", fractionsOf(paths.decisions, kGuidingDecisionNames)},
          {"firefly_cut_fraction", job.fireflyLimit && known ? nlohmann::ordered_json(cutFraction(job, run)) : nullptr},
          {"largest_contributions", known ? asJson(paths.largest) : nullptr},
          {"nonfinite_samples", run.film.dropped()}};
}

ImageAttributes attributes(const RenderJob& job, std::uint64_t sceneHash, const RunResult& run) {
  ImageAttributes all{{"software", fmt::format("Lobe {}", LOBE_VERSION)},
                      {"integrator", std::string(nameOf(run.integrator(job)))},
                      {"seed", static_cast<double>(job.seed)},
                      {"sampleOffset", static_cast<double>(job.sampleOffset)},
                      {"sceneHash", hashText(sceneHash)}};
  const auto [least, most] = run.film.sampleRange();
  if (least == most)
    all["samples"] = static_cast<double>(least);
  else  // without "samples", so that such a picture is not merged as if all pixels had equally many
    all["interrupted"] = fmt::format("{} to {} samples per pixel", least, most);
  if (job.fireflyLimit) {
    all["fireflyLimit"] = static_cast<double>(*job.fireflyLimit);
    if (coverPicture(run)) all["fireflyCut"] = cutFraction(job, run);
  }
  if (run.guiding.usesLightPaths) all["lightPathsPerPixel"] = run.guiding.lightPaths->pathsPerPixel;
  if (run.guiding.caches) all["cacheHashes"] = fmt::format("{:016x}", fmt::join(run.guiding.caches->hashes(), " "));
  if (job.gradients)
    all["gradients"] = *job.gradients == ReconstructionNorm::l2 ? "l2 (unbiased before clamping)" : "l1 (biased)";
  // Only written for --seconds, because pictures rendered with --spp must be byte-identical on every run.
  if (job.seconds) all["seconds"] = run.seconds();
  return all;
}

ConvergenceLog::ConvergenceLog(const RenderJob& job, const Scene& scene) : file_(job.convergence) {
  if (job.reference.empty()) return;
  reference_ = readImage(job.reference);
  const FilmCrop picture = scene.camera.picture();
  if (reference_->width != picture.width || reference_->height != picture.height)
    throw std::runtime_error(fmt::format("{}: the reference has {}x{} pixels, the picture {}x{}; use --size {}x{}",
                                         job.reference.string(), reference_->width, reference_->height, picture.width,
                                         picture.height, reference_->width, reference_->height));
}

void ConvergenceLog::add(const Image& picture, double seconds, int samples) {
  if (!reference_) return;
  const ErrorMetrics e = compareImages(*reference_, picture);
  text_ += fmt::format("{:.3f},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g}\n", seconds, samples, e.mse, e.relmse,
                       e.relmseDrop01, e.relmseDrop1, e.meanRatio);
}

void ConvergenceLog::write() const {
  if (reference_)
    writeAtomically(file_, "seconds,spp,mse,relmse,relmse_drop_0.1pct,relmse_drop_1pct,mean_ratio\n" + text_);
}

}  // namespace lobe
