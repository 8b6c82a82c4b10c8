// loberender: trains the illumination of a scene and renders it.

#include <algorithm>
#include <cstdint>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <oneapi/tbb/global_control.h>

#include "runtime/tools/check_report.h"
#include "runtime/tools/render_job.h"
#include "runtime/tools/tool.h"

namespace {

using namespace lobe;

/// Two numbers with a sign between them, as `form` shows it.
std::pair<int, int> parsePair(const std::string& option, const std::string& text, char sign, const char* form) {
  int first = 0, second = 0, end = 0;
  char between = 0;
  if (std::sscanf(text.c_str(), "%d%c%d%n", &first, &between, &second, &end) != 3 || between != sign ||
      end != static_cast<int>(text.size()))
    throw UsageError(option + ": '" + text + "' is not " + form);
  return {first, second};
}

constexpr std::uint64_t kMaxSeed = std::uint64_t{1} << 53;  // a picture's metadata holds it exactly

const std::vector<std::string> kIntegratorNames{"path", "guided", "product"};  // in the order of IntegratorKind
const std::vector<std::string> kFractionsNames{"fixed", "learnt"};

// Accepted in version 0.2 only.
const std::vector<RenamedOption> kRenamedOptions{
    {"--shares", "--bsdf-fraction"},
    {"--termination", "--russian-roulette", {{"plain", "throughput"}, {"window", "adjoint"}}},
};

struct Options {
  RenderJob job;
  std::string size, record, integrator = "product", fractions = "learnt";
  int threads = 0;
  bool check = false, json = false;
  std::vector<const CLI::Option*> training;  ///< options that only some integrators have a use for
};

/// --illumination goes with none of the options declared here.
void declareTraining(CLI::App& app, Options& options) {
  RenderJob& job = options.job;
  app.option_defaults()->group("Training");
  TrainingPlan& plan = job.training;
  app.add_option("--train", plan.from, "What records learn from: photons, paths (of the camera) or both")
      ->transform(CLI::CheckedTransformer(trainFromNames()))
      ->default_str("both");
  app.add_option("--passes", job.passes, "Training passes (default: 8, or as many as fit into the training's seconds)");
  app.add_option("--photons", plan.photons, "Photons a pass")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--importons", plan.importons, "Importons a pass")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--components", plan.records.components, "Gaussians of an illumination record, 1 to 8")
      ->check(CLI::Range(1, FieldOptions::kMostComponents))
      ->capture_default_str();
  app.add_option("--bsdf-fraction", options.fractions,
                 "BSDF sampling fraction of product: learnt by each record, or fixed")
      ->check(CLI::IsMember(kFractionsNames))
      ->capture_default_str();
  app.add_option("--train-seconds", job.trainSeconds,
                 "Training ends by then, as far as can be foreseen (default: 0.15 of --seconds; with --spp no limit)");
  const auto ofTraining = [&app] {
    return app.get_options([](const CLI::Option* o) { return o->get_group() == "Training"; });
  };
  for (const CLI::Option* option : ofTraining()) options.training.push_back(option);
  app.add_option("--save-illumination", job.saveIllumination, "Keep what was trained in this file (.illum)");
  auto* stored = app.add_option("--illumination", job.illumination,
                                "Use what an earlier run kept of the same scene, from whatever camera; do not train");
  for (CLI::Option* option : ofTraining())
    if (option != stored) stored->excludes(option);
  app.option_defaults()->group("Options");
}

void declare(CLI::App& app, Options& options) {
  RenderJob& job = options.job;
  app.add_option("scene", job.scene, "Mitsuba scene file (XML)")->required();
  app.add_option("-o,--output", job.outputs, "Picture, .exr or .png; may be given several times")
      ->allow_extra_args(false);  // else it would swallow the scene's name after it
  app.add_option("--cache", job.cacheFolder, "Folder of the caches that lobefit made")->capture_default_str();
  app.add_option("--integrator", options.integrator, "path, guided or product")
      ->check(CLI::IsMember(kIntegratorNames))
      ->capture_default_str();
  app.add_option("--spp", job.samples, "Samples per pixel");
  app.add_option("--sample-offset", job.sampleOffset,
                 "First of these samples: parts of a picture for lobecompare --merge")
      ->capture_default_str();
  app.add_option("--seconds", job.seconds, "Seconds of training and rendering, instead of --spp");
  app.add_option("--size", options.size, "WIDTHxHEIGHT in pixels, instead of the scene's");
  app.add_option("--max-depth", job.maxDepth, "Longest path in segments (default: the scene's max_depth, or no limit)");
  app.add_option("--reduction", job.reduction,
                 "Merge Gaussians of lobes and records up to this cost (Runnalls; 0: none, the paper: 0.2)")
      ->capture_default_str();
  app.add_option("--russian-roulette", job.russianRoulette,
                 "Russian roulette by throughput, or adjoint: adjoint-driven, with splitting (guided, product)")
      ->transform(CLI::CheckedTransformer(std::map<std::string, RussianRoulette>{
          {"throughput", RussianRoulette::throughput}, {"adjoint", RussianRoulette::adjoint}}))
      ->default_str("adjoint");
  app.add_option("--seed", job.seed, "Random seed")
      ->check(CLI::Range(std::uint64_t{0}, kMaxSeed))
      ->capture_default_str();
  app.add_option("--reference", job.reference, "Picture to measure the error against while rendering");
  app.add_option("--convergence", job.convergence, "CSV of that error over time");
  app.add_option("--stats", job.stats, "JSON file for the run's statistics");
  auto* record =
      app.add_option("--record", options.record,
                     "X,Y: draw the illumination record that serves what this pixel shows (0,0 is top left)");
  app.add_option("--record-image", job.recordImage,
                 "PNG for it: mixture, particles of the last pass and incident light over the disc of directions")
      ->needs(record)
      ->capture_default_str();
  app.add_flag("--lenient", job.lenient, "Replace or leave out what is at fault in the scene, with warnings");
  auto* check =
      app.add_flag("--check", options.check, "Only read the scene and print all that is found; exit 1 on faults");
  app.add_flag("--json", options.json, "Print what --check finds as JSON")->needs(check);
  declareTraining(app, options);
  addDefinitions(app, job.definitions);
  addThreads(app, options.threads);
}

/// What an integrator has no use for is passed over, so that a script may give the same options to all of them.
void noteUnused(const Options& options) {
  std::vector<std::string> unused;
  for (const CLI::Option* option : options.training) {
    const bool used =
        options.integrator == "product" || (options.integrator == "guided" && option->get_name() != "--bsdf-fraction");
    if (option->count() > 0 && !used) unused.push_back(option->get_name());
  }
  if (!unused.empty())
    printNote("loberender", fmt::format("{} has no use for {}", options.integrator, fmt::join(unused, ", ")));
}

void work(Options& options) {
  if (options.check)
    return reportCheck(options.job.scene, {options.job.definitions, options.job.lenient}, options.json, stdout);
  const auto name = std::ranges::find(kIntegratorNames, options.integrator);
  options.job.integrator = static_cast<IntegratorKind>(name - kIntegratorNames.begin());
  options.job.training.learnFractions = options.fractions == "learnt";
  if (!options.size.empty()) options.job.size = parsePair("--size", options.size, 'x', "WIDTHxHEIGHT");
  if (!options.record.empty()) options.job.record = parsePair("--record", options.record, ',', "X,Y");
  noteUnused(options);
  std::optional<oneapi::tbb::global_control> limit;
  if (options.threads > 0) limit.emplace(oneapi::tbb::global_control::max_allowed_parallelism, options.threads);
  run(options.job);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  return runTool(
      "loberender", "Trains the illumination of a scene and renders it.", argc, argv,
      [&](CLI::App& app) { declare(app, options); }, [&] { work(options); }, kRenamedOptions);
}
