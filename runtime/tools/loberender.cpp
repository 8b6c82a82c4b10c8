// loberender: trains the illumination of a scene and renders it.

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <sstream>
#include <system_error>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <oneapi/tbb/global_control.h>
#include <CLI/CLI.hpp>

#include "runtime/tools/check_report.h"
#include "runtime/tools/exr_options.h"
#include "runtime/tools/option_names.h"
#include "runtime/tools/render_run.h"
#include "runtime/tools/tool.h"

namespace {

using namespace lobe;

/// Parses the list of --aov.
std::set<Aov> parseAovs(const std::string& text) {
  std::set<Aov> aovs;
  std::istringstream list(text);
  list.exceptions(std::ios::badbit);  // otherwise too little memory would look like the end of the list
  for (std::string name; std::getline(list, name, ',');) {
    const auto found = std::ranges::find(kAovNames, name);
    if (name == "all")
      for (std::size_t i = 0; i < kAovNames.size(); ++i) aovs.insert(static_cast<Aov>(i));
    else if (found != kAovNames.end())
      aovs.insert(static_cast<Aov>(found - kAovNames.begin()));
    else
      throw UsageError(fmt::format("--aov: '{}' is not one of {}, or all", name, fmt::join(kAovNames, ", ")));
  }
  return aovs;
}

/// Parses two numbers separated by `sign`; `form` describes the format in the error message.
std::pair<int, int> parsePair(const std::string& option, const std::string& text, char sign, const char* form) {
  const char* const end = text.data() + text.size();
  int first = 0, second = 0;
  const auto [between, error] = std::from_chars(text.data(), end, first);
  if (error == std::errc() && between != end && *between == sign) {
    const auto [rest, errorOfSecond] = std::from_chars(between + 1, end, second);
    if (errorOfSecond == std::errc() && rest == end) return {first, second};
  }
  throw UsageError(option + ": '" + text + "' is not " + form);
}

constexpr std::uint64_t kMaxSeed = std::uint64_t{1} << 53;  // the metadata of a picture stores it exactly

template <class Enumeration>
using Names = std::vector<std::pair<std::string, Enumeration>>;

const Names<IntegratorKind> kIntegratorNames{{"auto", IntegratorKind::automatic}, {"path", IntegratorKind::path},
                                             {"bdpt", IntegratorKind::bdpt},      {"vcm", IntegratorKind::vcm},
                                             {"guided", IntegratorKind::guided},  {"product", IntegratorKind::product}};
const Names<BdptGuide> kGuideNames{
    {"none", BdptGuide::none}, {"illumination", BdptGuide::illumination}, {"product", BdptGuide::product}};
const Names<LightPathUse> kLightPathNames{
    {"auto", LightPathUse::automatic}, {"on", LightPathUse::on}, {"off", LightPathUse::off}};
const Names<RussianRoulette> kRussianRouletteNames{{"throughput", RussianRoulette::throughput},
                                                   {"efficiency", RussianRoulette::efficiency}};
const Names<PixelFiltering> kFilteringNames{{"splatting", PixelFiltering::splatting},
                                            {"importance", PixelFiltering::importance}};
const Names<PixelSampling> kSamplerNames{{"sobol", PixelSampling::sobol}, {"independent", PixelSampling::independent}};
const Names<ReconstructionNorm> kNormNames{{"l2", ReconstructionNorm::l2}, {"l1", ReconstructionNorm::l1}};
const Names<bool> kFractionsNames{{"fixed", false}, {"learnt", true}};

// The old names are accepted in version 0.2 only.
const std::vector<RenamedOption> kRenamedOptions{
    {"--shares", "--bsdf-fraction"},
    {"--termination", "--russian-roulette", {{"plain", "throughput"}, {"window", "efficiency"}}},
};

struct Options {
  RenderJob job;
  std::string size, record, aovs;
  int threads = 0;
  bool check = false, json = false;
  // Options that some integrators, or gradients, ignore.
  const CLI::Option *guide = nullptr, *reduction = nullptr, *roulette = nullptr, *lightPaths = nullptr,
                    *shadowSurfaces = nullptr, *filtering = nullptr;
  std::vector<const CLI::Option*> training, merging;
  std::vector<CLI::Option*> exr;  // for .exr files only
};

/// Declares the training options.
void declareTraining(CLI::App& app, Options& options) {
  RenderJob& job = options.job;
  app.option_defaults()->group("Training");
  TrainingPlan& plan = job.training;
  app.add_option("--train", plan.from, "Source of the training samples: photons, camera paths or both")
      ->transform(oneOf(trainFromNames()))
      ->default_str("both");
  app.add_option("--passes", job.passes,
                 "Number of training passes (default: 8, or unlimited if the training time is limited)");
  app.add_option("--photons", plan.photons, "Number of photons per pass")
      ->check(CLI::Range(1, TrainingPlan::kMostParticles))
      ->capture_default_str();
  app.add_option("--importons", plan.importons, "Number of importons per pass")
      ->check(CLI::Range(1, TrainingPlan::kMostParticles))
      ->capture_default_str();
  app.add_option("--components", plan.records.components, "Number of Gaussians per illumination record")
      ->check(CLI::Range(1, FieldOptions::kMostComponents))
      ->capture_default_str();
  app.add_option("--bsdf-fraction", plan.learnFractions,
                 "BSDF sampling fraction of the product integrator: learnt for each record, or fixed")
      ->transform(oneOf(kFractionsNames))
      ->default_str("learnt");
  app.add_option("--train-seconds", job.trainSeconds,
                 "Approximate time limit for training in seconds (default: 15 % of --seconds, or no limit with --spp)");
  for (const CLI::Option* option : app.get_options([](const CLI::Option* o) { return o->get_group() == "Training"; }))
    options.training.push_back(option);
  app.add_option("--save-illumination", job.saveIllumination, "Save the trained illumination to this file")
      ->type_name("OUT.illum");
  app.add_option("--illumination", job.illumination,
                 "Load illumination saved by an earlier run for the same scene (with any camera) instead of training; "
                 "with --passes or --train-seconds, go on with the training, which adds records where there are none")
      ->type_name("FILE.illum");
  app.option_defaults()->group("Options");
}

/// Declares the options of bdpt and vcm.
void declareBidirectional(CLI::App& app, Options& options) {
  RenderJob& job = options.job;
  options.guide =
      app.add_option("--guide", job.guide,
                     "Guiding of bdpt: none, illumination (camera paths by illumination, light paths by importance) or "
                     "product (camera paths by BRDF times illumination)")
          ->transform(oneOf(kGuideNames))
          ->default_str("none");
  options.merging = {
      app.add_option("--merge-radius", job.merge.first,
                     "Radius of vertex merging of vcm in the first sample, as a fraction of the visible region's "
                     "diagonal; the bias of the picture vanishes with it")
          ->capture_default_str(),
      app.add_option("--merge-alpha", job.merge.alpha,
                     "Reduction of this radius: sample i has the radius times i to the power (alpha - 1)/2")
          ->capture_default_str()};
}

void declare(CLI::App& app, Options& options) {
  RenderJob& job = options.job;
  app.add_option("scene", job.scene, "Mitsuba scene file")->required()->type_name("SCENE.xml");
  app.add_option("--camera", job.camera,
                 "Take the sensor, with its film, from this scene file instead of the scene's own")
      ->type_name("FILE.xml");
  // A vector would be shown as "FILE ...", as if one -o took several files.
  app.add_option_function<std::string>(
         "-o,--output", [&job](const std::string& file) { job.outputs.emplace_back(file); },
         "Output picture, .exr or .png (repeatable: one file each)")
      ->type_name("FILE")
      ->trigger_on_parse()
      ->allow_extra_args(false);
  auto* aovs =
      app.add_option("--aov", options.aovs,
                     fmt::format("AOVs that are stored with the picture in .exr files, separated by commas: {}, or all",
                                 fmt::join(kAovNames, ", ")))
          ->type_name("LIST");
  options.exr = addExrOptions(app, job.exr);
  options.exr.push_back(aovs);
  app.add_option("--cache", job.cacheFolder, "Folder of the BRDF caches made by lobefit")
      ->type_name("DIR")
      ->capture_default_str();
  app.add_option("--integrator", job.integrator,
                 "Integrator: path (BSDF sampling), bdpt (bidirectional path tracing), vcm (vertex connection and "
                 "merging, which is biased but consistent), guided (illumination and BSDF), product (BRDF times "
                 "illumination), or auto: path or product, whichever has the lower error in a short comparison")
      ->transform(oneOf(kIntegratorNames))
      ->default_str("auto");
  declareBidirectional(app, options);
  app.add_option(
         "--gradients", job.gradients,
         "Gradient-domain rendering with path, bdpt, guided or product: samples the differences of neighbouring "
         "pixels, too, and reconstructs the picture from them in l2 (unbiased, except that negative pixels become "
         "zero) or l1 (less noise from outliers, but biased)")
      ->transform(oneOf(kNormNames));
  app.add_option("--spp", job.samples, "Number of samples per pixel");
  app.add_option("--sample-offset", job.sampleOffset,
                 "Index of the first sample, to render parts of a picture for lobecompare --merge")
      ->capture_default_str();
  app.add_option("--seconds", job.seconds, "Time for training and rendering in seconds, instead of --spp");
  app.add_option("--size", options.size, "Picture size in pixels (default: the size in the scene)")
      ->type_name("WIDTHxHEIGHT");
  app.add_option("--max-depth", job.maxDepth,
                 "Maximum path length in segments (default: max_depth of the scene, or no limit)");
  app.add_option(
         "--reduction", job.reduction,
         "Merge Gaussians of BRDF caches and illumination records up to this cost (Runnalls 2007; 0: no merging)")
      ->capture_default_str();
  app.add_option(
         "--russian-roulette", job.russianRoulette,
         "Russian roulette by throughput, or efficiency-aware Russian roulette and splitting (guided and product)")
      ->transform(oneOf(kRussianRouletteNames))
      ->default_str("efficiency");
  app.add_option(
         "--light-paths", job.lightPaths,
         "Combine the camera paths of guided and product with light paths that are connected to the camera, which "
         "find caustics: on, off, or auto: where they lower the variance of all pixels in equal time to a quarter")
      ->transform(oneOf(kLightPathNames))
      ->default_str("auto");
  app.add_option("--shadow-surfaces", job.shadowSurfaces,
                 "Number of glass, mask or null surfaces that next-event estimation sees through (0: none)")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  app.add_option(
         "--firefly-limit", job.fireflyLimit,
         "Limit the luminance of the indirect light in a sample of a pixel; the picture is then biased, and its "
         "metadata say how much light was cut off (default: no limit)")
      ->type_name("LUMINANCE");
  app.add_option("--sampler", job.sampling, "Random numbers of a pixel: Owen-scrambled Sobol' points, or independent")
      ->transform(oneOf(kSamplerNames))
      ->default_str("sobol");
  app.add_option("--filtering", job.filtering,
                 "How samples contribute to pixels: splatting (to all whose filter covers them: less noise) or "
                 "importance (to one pixel, sampled from its filter: independent noise, as denoisers expect)")
      ->transform(oneOf(kFilteringNames))
      ->default_str("splatting");
  app.add_option("--seed", job.seed, "Random seed")
      ->check(CLI::Range(std::uint64_t{0}, kMaxSeed))
      ->capture_default_str();
  app.add_option("--reference", job.reference, "Reference picture for --convergence")->type_name("FILE");
  app.add_option("--convergence", job.convergence, "Write the error against --reference over time to this CSV file")
      ->type_name("OUT.csv");
  app.add_option("--snapshot-every", job.snapshotEvery,
                 "Write the outputs as they are every so many seconds while rendering; 0: only at the end (default: "
                 "60 with --checkpoint and in runs of over 2 minutes, or 0)")
      ->type_name("SECONDS");
  app.add_option("--checkpoint", job.checkpoint,
                 "Write the state of the run to this file with every snapshot and when it is interrupted")
      ->type_name("FILE");
  app.add_option("--resume", job.resume, "Continue the run that wrote this checkpoint; give the same options again")
      ->type_name("FILE");
  app.add_option("--stats", job.stats, "Write statistics of the run to this JSON file")->type_name("OUT.json");
  auto* record =
      app.add_option("--record", options.record,
                     "Plot the illumination record that serves the surface seen in this pixel (0,0 is top left)")
          ->type_name("X,Y");
  app.add_option("--record-image", job.recordImage,
                 "PNG file for --record: mixture, particles of the last pass and incident radiance over the disc of "
                 "directions")
      ->type_name("OUT.png")
      ->needs(record)
      ->capture_default_str();
  app.add_flag("--lenient", job.lenient, "Replace or leave out faulty parts of the scene, with warnings");
  auto* check =
      app.add_flag("--check", options.check,
                   "Only read the scene and print all faults, warnings and notes; exit with 1 if it cannot be read");
  app.add_flag("--json", options.json, "Print the result of --check as JSON")->needs(check);
  options.reduction = app.get_option("--reduction");
  options.lightPaths = app.get_option("--light-paths");
  options.shadowSurfaces = app.get_option("--shadow-surfaces");
  options.filtering = app.get_option("--filtering");
  options.roulette = app.get_option("--russian-roulette");
  declareTraining(app, options);
  addDefinitions(app, job.definitions);
  addThreads(app, options.threads);
}

/// Options that the integrator or --gradients ignores are not errors, so that a script can pass the same options to all
/// integrators.
void noteUnused(const Options& options) {
  const RenderJob& job = options.job;
  std::vector<std::string> unused, unusedByGradients;
  const auto note = [&](const CLI::Option* option, bool used, bool usedByGradients = true) {
    if (option->count() == 0) return;
    if (!used)
      unused.push_back(option->get_name());
    else if (job.gradients && !usedByGradients)
      unusedByGradients.push_back(option->get_name());
  };
  note(options.guide, job.integrator == IntegratorKind::bdpt);
  for (const CLI::Option* option : options.merging) note(option, job.integrator == IntegratorKind::vcm);
  for (const CLI::Option* option : options.training)
    note(option, option->get_name() == "--bsdf-fraction" ? job.mayUseProduct() : job.guided());
  note(options.reduction, job.guided());
  const bool isUnidirectional = job.guided() && job.integrator != IntegratorKind::bdpt;
  note(options.lightPaths, isUnidirectional, job.lightPaths == LightPathUse::off);
  note(options.shadowSurfaces, job.connectsThroughSurfaces());
  note(options.roulette, isUnidirectional, job.russianRoulette == RussianRoulette::throughput);
  note(options.filtering, true, job.filtering == PixelFiltering::importance);
  if (!unused.empty())
    printNote("loberender", fmt::format("--integrator {} ignores {}", nameOf(job.integrator), fmt::join(unused, ", ")));
  if (!unusedByGradients.empty())
    printNote("loberender", fmt::format("--gradients ignores {}", fmt::join(unusedByGradients, ", ")));
}

/// AOVs and the format of pixels are for .exr files only.
void noteWithoutExr(Options& options) {
  RenderJob& job = options.job;
  if (job.outputs.empty() || std::ranges::any_of(job.outputs, isExrName)) return;
  for (const CLI::Option* option : options.exr)
    if (option->count() > 0)
      printNote("loberender", fmt::format("{} has no effect, because no output is an .exr file", option->get_name()));
  job.aovs.clear();
}

/// Stored illumination that is not trained further leaves no use for the options of training.
void checkTraining(const Options& options) {
  if (options.job.illumination.empty() || options.job.trainsFurther()) return;
  for (const CLI::Option* option : options.training)
    if (option->count() > 0)
      throw UsageError(
          fmt::format("{} has no effect with --illumination, except with --passes or --train-seconds, which "
                      "continue the training",
                      option->get_name()));
}

void work(Options& options) {
  const RenderJob& job = options.job;
  if (options.check)
    return reportCheck(job.scene, {job.definitions, job.lenient, true, {}, job.camera}, options.json, stdout);
  checkTraining(options);
  if (!options.size.empty()) options.job.size = parsePair("--size", options.size, 'x', "WIDTHxHEIGHT");
  options.job.aovs = parseAovs(options.aovs);
  if (!options.record.empty()) options.job.record = parsePair("--record", options.record, ',', "X,Y");
  noteUnused(options);
  noteWithoutExr(options);
  std::optional<oneapi::tbb::global_control> limit;
  if (options.threads > 0) limit.emplace(oneapi::tbb::global_control::max_allowed_parallelism, options.threads);
  run(options.job, stopOnSignals());
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  return runTool(
      "loberender", "Renders a scene by path tracing or path guiding; guiding first trains the illumination.", argc,
      argv, [&](CLI::App& app) { declare(app, options); }, [&] { work(options); }, kRenamedOptions);
}
