#include "runtime/tools/checkpoint.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

namespace lobe {
namespace {

static_assert(sizeof(Film::Pixel) == sizeof(StoredPixel));

StoredPixel stored(const Film::Pixel& p) {
  return {{p.sum[0], p.sum[1], p.sum[2]}, {p.squares[0], p.squares[1], p.squares[2]}, p.count, p.dropped};
}

Film::Pixel loaded(const StoredPixel& p) {
  return {{p.sum[0], p.sum[1], p.sum[2]}, {p.squares[0], p.squares[1], p.squares[2]}, p.count, p.dropped};
}

std::optional<StoredPilot> storedPilot(const std::optional<Pilot>& p) {
  if (!p) return std::nullopt;
  return StoredPilot{p->path.variance, p->path.cost, p->product.variance, p->product.cost, p->limit, p->seconds};
}

std::optional<StoredLightPathTrial> storedTrial(const std::optional<LightPathTrial>& t, double seconds) {
  if (!t) return std::nullopt;
  return StoredLightPathTrial{t->variance,         t->cost,          t->pathsPerPixel, t->secondMoment,
                              t->secondMomentLeft, t->costWithLight, seconds};
}

/// All counters of the statistics, in a fixed order.
template <class Statistics>
auto countersOf(Statistics& statistics) {
  std::vector<decltype(&statistics.paths)> all{&statistics.paths, &statistics.segments, &statistics.shadowRays};
  for (auto& count : statistics.strategies) all.push_back(&count);
  for (auto& count : statistics.decisions) all.push_back(&count);
  for (auto& key : statistics.largest.keys) all.push_back(&key);
  all.push_back(&statistics.cut.units);
  return all;
}

}  // namespace

void checkSameRun(const CheckpointFile& file, const std::filesystem::path& path, const RunSettings& settings) {
  const RunSettings& stored = file.info().settings;
  for (std::size_t i = 0; i < std::min(stored.size(), settings.size()); ++i) {
    if (stored[i] == settings[i]) continue;
    const auto& [name, value] = settings[i];
    if (stored[i].first != name) break;
    throw std::runtime_error(fmt::format("{}: a checkpoint of another run: {} was {}, and is {} now", path.string(),
                                         name, stored[i].second, value));
  }
  if (stored != settings)
    throw std::runtime_error(fmt::format("{}: a checkpoint of another run: it has other settings", path.string()));
}

std::vector<std::byte> encodeCheckpoint(const RunSettings& settings, const Film& film, const RenderResult& result,
                                        const Guiding& guiding, std::span<const std::byte> illumination,
                                        std::span<const std::byte> importance) {
  const TrainingReport& training = guiding.training.report;
  CheckpointInfo info;
  info.settings = settings;
  info.width = static_cast<std::uint32_t>(film.width());
  info.height = static_cast<std::uint32_t>(film.height());
  info.trainingSeconds = training.seconds;
  info.renderingSeconds = result.total.seconds;
  for (const PassReport& pass : training.passes)
    info.passes.push_back({pass.seconds, pass.particles, pass.records,
                           pass.logLikelihood.value_or(std::numeric_limits<double>::quiet_NaN())});
  info.undersampledFraction = training.undersampledFraction;
  info.learntFractions = training.learntFractions;
  info.pilot = storedPilot(guiding.pilot);
  info.lightPathTrial = storedTrial(guiding.lightPaths, guiding.secondsLightPaths);
  for (const std::uint64_t* count : countersOf(result.statistics)) info.counters.push_back(*count);
  std::vector<StoredPixel> pixels(film.pixels().size());
  std::ranges::transform(film.pixels(), pixels.begin(), stored);
  return encodeCheckpoint(info, pixels, illumination, importance);
}

Film filmOf(const CheckpointFile& file) {
  std::vector<Film::Pixel> pixels(file.pixels().size());
  std::ranges::transform(file.pixels(), pixels.begin(), loaded);
  return {static_cast<int>(file.info().width), static_cast<int>(file.info().height), std::move(pixels)};
}

RenderResult resultOf(const CheckpointFile& file, const std::filesystem::path& path) {
  RenderResult result;
  result.total.seconds = file.info().renderingSeconds;
  const std::vector<std::uint64_t*> counters = countersOf(result.statistics);
  if (counters.size() != file.info().counters.size())
    throw std::runtime_error(fmt::format("{}: damaged: {} counters, expected {}", path.string(),
                                         file.info().counters.size(), counters.size()));
  for (std::size_t i = 0; i < counters.size(); ++i) *counters[i] = file.info().counters[i];
  if (!result.statistics.largest.isValid())
    throw std::runtime_error(fmt::format("{}: damaged: impossible contributions of paths", path.string()));
  return result;
}

TrainingReport trainingOf(const CheckpointFile& file) {
  TrainingReport report;
  for (const StoredPass& pass : file.info().passes)
    report.passes.push_back({pass.seconds, pass.particles, static_cast<std::size_t>(pass.records),
                             std::isnan(pass.logLikelihood) ? std::nullopt : std::optional(pass.logLikelihood)});
  report.seconds = file.info().trainingSeconds;
  report.undersampledFraction = file.info().undersampledFraction;
  report.learntFractions = file.info().learntFractions;
  return report;
}

void restoreChoices(const CheckpointFile& file, Guiding& guiding) {
  if (const auto& p = file.info().pilot)
    guiding.pilot = Pilot{{{p->pathVariance, p->pathCost}, {p->productVariance, p->productCost}, p->limit}, p->seconds};
  if (const auto& t = file.info().lightPathTrial) {
    guiding.lightPaths = {t->variance, t->cost, t->pathsPerPixel, t->secondMoment, t->left, t->costWithLight};
    guiding.secondsLightPaths = t->seconds;
  }
}

}  // namespace lobe
