// lobecompare: measures the errors of images against a reference or the variance of a pair, merges or converts images.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <set>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "runtime/core/files.h"
#include "runtime/image/agreement.h"
#include "runtime/image/error_map.h"
#include "runtime/image/error_metrics.h"
#include "runtime/image/image_output.h"
#include "runtime/image/merge.h"
#include "runtime/image/pair_variance.h"
#include "runtime/tools/exr_options.h"
#include "runtime/tools/json_text.h"
#include "runtime/tools/option_names.h"
#include "runtime/tools/tool.h"

namespace {

struct Arguments {
  std::string reference;
  std::vector<std::string> images, others;
  bool json = false, pair = false, png = false;
  float exposure = 0;
  lobe::ExrFormat exr;
  std::string map, merge, variance;
  int shrink = 1;
};

struct Comparison {
  std::string image;
  lobe::ErrorMetrics metrics;
};

void declare(CLI::App& app, Arguments& arguments) {
  app.add_option("REFERENCE", arguments.reference,
                 "Reference image; with --merge or --pair, the first of the images; with --png, the input")
      ->required()
      ->type_name("FILE");
  // Its number is checked later: if it were required here, it would take the last image of --agree-with.
  app.add_option("IMAGE", arguments.images,
                 "Images of the same size as the reference, at least one; with --png, the output")
      ->type_name("FILE")
      ->default_str("");
  auto* json = app.add_flag("--json", arguments.json, "Print the errors as JSON");
  auto* map = app.add_option(
      "--map", arguments.map,
      fmt::format("Write a map of the relative error (with --pair: variance) of each pixel of a single image to this "
                  "PNG file, from {:g} (black) over blue, red and yellow to {:g} (white)",
                  lobe::kMapLow, lobe::kMapHigh));
  map->type_name("OUT.png");
  auto* shrink = app.add_option("--shrink", arguments.shrink, "First average the reference over squares of N×N pixels")
                     ->check(CLI::Range(1, 1024))
                     ->type_name("N");
  auto* pair = app.add_flag("--pair", arguments.pair,
                            "Take two images of one method with different seeds, and print the relative variance of a "
                            "pixel with 95 % confidence intervals; no reference is needed")
                   ->excludes(shrink);
  auto* agreement = app.add_option("--agree-with", arguments.others,
                                   "Test whether the images of one method, at least two with different seeds, and "
                                   "these images of another method can have the same expected value")
                        ->type_name("FILE")
                        ->excludes(map)
                        ->excludes(pair)
                        ->excludes(shrink)
                        ->default_str("");
  auto* merge =
      app.add_option("--merge", arguments.merge,
                     "Write the mean of all images, weighted by their numbers of samples, to this EXR file, instead of "
                     "comparing them")
          ->type_name("OUT.exr")
          ->excludes(agreement)
          ->excludes(json)
          ->excludes(map)
          ->excludes(pair)
          ->excludes(shrink);
  app.add_option("--variance", arguments.variance,
                 "With --merge of images with different seeds: write the variance of the merged image to this EXR file")
      ->type_name("OUT.exr")
      ->needs(merge);
  for (CLI::Option* option : lobe::addExrOptions(app, arguments.exr)) option->needs(merge);
  auto* png = app.add_flag("--png", arguments.png,
                           "Convert the first image to the second, a PNG file in sRGB as loberender writes it, instead "
                           "of comparing them");
  png->excludes(json)->excludes(map)->excludes(shrink)->excludes(merge)->excludes(agreement)->excludes(pair);
  app.add_option("--exposure", arguments.exposure, "Multiply the image by 2 to this power for --png")
      ->check(lobe::fromTo(-100, 100))
      ->type_name("STOPS")
      ->needs(png);
}

std::vector<std::filesystem::path> all(const Arguments& arguments) {
  std::vector<std::filesystem::path> paths{arguments.reference};
  paths.insert(paths.end(), arguments.images.begin(), arguments.images.end());
  return paths;
}

void checkMerge(const Arguments& arguments) {
  if (lobe::extensionOf(arguments.merge) != ".exr")
    throw lobe::UsageError("--merge must name an .exr file, because it stores the number of samples");
  if (!arguments.variance.empty() && lobe::extensionOf(arguments.variance) != ".exr")
    throw lobe::UsageError("--variance must name an .exr file");
}

void checkPng(const Arguments& arguments) {
  if (arguments.images.size() != 1) throw lobe::UsageError("--png takes two files, the input and the output");
  const std::filesystem::path output = arguments.images.front();
  if (lobe::extensionOf(output) != ".png")
    throw lobe::UsageError(fmt::format("{}: --png writes its second file, which must be a .png file", output.string()));
  lobe::checkOutputs({output}, {arguments.reference});
}

void checkNumber(const Arguments& arguments) {
  if (!arguments.others.empty() && (arguments.images.empty() || arguments.others.size() < 2))
    throw lobe::UsageError("--agree-with needs at least two images of each method");
  if (arguments.images.empty()) throw lobe::UsageError("IMAGE is required (see lobecompare --help)");
}

void checkArguments(const Arguments& arguments) {
  checkNumber(arguments);
  if (arguments.png) return checkPng(arguments);
  if (!arguments.merge.empty()) checkMerge(arguments);
  if (arguments.pair && arguments.images.size() != 1) throw lobe::UsageError("--pair takes two images");
  lobe::checkOutputs({arguments.merge, arguments.variance, arguments.map}, all(arguments));
  if (arguments.map.empty()) return;
  if (arguments.images.size() > 1) throw lobe::UsageError("--map takes one image, but several are given");
  if (lobe::extensionOf(arguments.map) != ".png") throw lobe::UsageError("--map must name a .png file");
}

/// Adds the name of the image to the message of an error.
template <class Measure>
auto measured(const std::string& name, const Measure& measure) {
  try {
    return measure();
  } catch (const std::runtime_error& e) {
    throw std::runtime_error(fmt::format("{}: {}", name, e.what()));
  }
}

/// The value of an attribute; null without one of this type.
template <class Value>
const Value* valueOf(const lobe::ImageAttributes& attributes, const char* key) {
  const auto found = attributes.find(key);
  return found == attributes.end() ? nullptr : std::get_if<Value>(&found->second);
}

/// Such pixels are black, whatever the expected value of the picture.
void noteMissingSamples(const std::string& name) {
  const lobe::ImageAttributes attributes = lobe::readAttributes(name);
  const auto* samples = valueOf<lobe::AttributeText>(attributes, "interrupted");
  if (samples && samples->starts_with("0 "))
    lobe::printNote("lobecompare", fmt::format("{}: its run was interrupted in the first pass, and it has {}; pixels "
                                               "without a sample are black",
                                               name, *samples));
}

/// A map that cannot be written is added to the errors.
Comparison compare(const lobe::Image& reference, const std::string& name, const std::string& map,
                   lobe::OutputErrors& errors) {
  const lobe::Image image = lobe::readImage(name);
  noteMissingSamples(name);
  Comparison result{name, measured(name, [&] { return lobe::compareImages(reference, image); })};
  if (!map.empty())
    errors.attempt(map, [&] { lobe::writeErrorMap(map, image.width, lobe::relativeErrors(reference, image)); });
  return result;
}

void printJson(const std::vector<Comparison>& comparisons) {
  nlohmann::ordered_json array = nlohmann::ordered_json::array();
  for (const auto& [image, m] : comparisons)
    array.push_back({{"image", image},
                     {"mse", m.mse},
                     {"relmse", m.relmse},
                     {"relmse_error", m.relmseError},
                     {"relmse_drop_0.1pct", m.relmseDrop01},
                     {"relmse_drop_1pct", m.relmseDrop1},
                     {"mean_ratio", m.meanRatio},
                     {"nonfinite", m.nonfinite},
                     {"worst_0.01pct_fraction", m.worst.fraction001},
                     {"worst_0.1pct_fraction", m.worst.fraction01},
                     {"worst_1pct_fraction", m.worst.fraction1},
                     {"fireflies", m.fireflies}});
  fmt::print("{}\n", lobe::jsonText(array));
}

/// The text of a value; a dash if it is NaN.
std::string orDash(double value, const std::string& text) {
  return std::isnan(value) ? "–" : text;
}

void printTable(const std::vector<Comparison>& comparisons) {
  lobe::Table table({"image", "mse", "relmse", "without worst 0.1 %", "without worst 1 %", "ratio of means",
                     "non-finite", "worst 0.01 / 0.1 / 1 % of the error", "fireflies"});
  for (const auto& [image, m] : comparisons)
    table.add({image, fmt::format("{:.6g}", m.mse),
               fmt::format("{:.6g} ± {}", m.relmse, orDash(m.relmseError, fmt::format("{:.2g}", m.relmseError))),
               fmt::format("{:.6g}", m.relmseDrop01), fmt::format("{:.6g}", m.relmseDrop1),
               orDash(m.meanRatio, fmt::format("{:.5f}", m.meanRatio)), fmt::format("{}", m.nonfinite),
               fmt::format("{:.0f} / {:.0f} / {:.0f} %", 100 * m.worst.fraction001, 100 * m.worst.fraction01,
                           100 * m.worst.fraction1),
               fmt::format("{}", m.fireflies)});
  table.print(stdout);
}

// ---- Pairs

nlohmann::ordered_json intervalJson(const lobe::Interval& interval) {
  return {interval.low, interval.high};
}

void printJson(const lobe::PairVariance& v, const Arguments& arguments) {
  const nlohmann::ordered_json json{{"images", all(arguments)},
                                    {"relvar", v.all.value},
                                    {"relvar_interval", intervalJson(v.all.interval)},
                                    {"relvar_drop_0.1pct", v.drop01.value},
                                    {"relvar_drop_0.1pct_interval", intervalJson(v.drop01.interval)},
                                    {"relvar_drop_1pct", v.drop1.value},
                                    {"relvar_drop_1pct_interval", intervalJson(v.drop1.interval)},
                                    {"mean_ratio", v.meanRatio},
                                    {"nonfinite", v.nonfinite}};
  fmt::print("{}\n", lobe::jsonText(json));
}

std::string textOf(const lobe::MeanEstimate& e) {
  const std::string interval = fmt::format("{:.4g}, {:.4g}", e.interval.low, e.interval.high);
  return fmt::format("{} [{}]", orDash(e.value, fmt::format("{:.6g}", e.value)), orDash(e.interval.low, interval));
}

void printTable(const lobe::PairVariance& v, const Arguments& arguments) {
  lobe::Table table({"images", "relative variance [95 %]", "without worst 0.1 %", "without worst 1 %", "ratio of means",
                     "non-finite"});
  table.add({arguments.reference + ", " + arguments.images[0], textOf(v.all), textOf(v.drop01), textOf(v.drop1),
             orDash(v.meanRatio, fmt::format("{:.5f}", v.meanRatio)), fmt::format("{}", v.nonfinite)});
  table.print(stdout);
}

/// Prints a note if both pictures have the attribute, with different values. Returns whether. Such pictures are
/// compared, too, because integrators without a bias have the same expected picture. what: the attribute, in the
/// plural.
bool noteDifferent(const std::string& a, const std::string& b, const char* key, const char* what) {
  const lobe::ImageAttributes ofA = lobe::readAttributes(a), ofB = lobe::readAttributes(b);
  const auto one = ofA.find(key), other = ofB.find(key);
  if (one == ofA.end() || other == ofB.end() || one->second == other->second) return false;
  lobe::printNote("lobecompare", fmt::format("{} and {}: are pictures of different {}; their difference is noise alone "
                                             "only if both have the same expected value",
                                             a, b, what));
  return true;
}

bool noteDifferentScenes(const std::string& a, const std::string& b) {
  return noteDifferent(a, b, "sceneHash", "scenes or cameras");
}

/// The attribute as text; empty without it.
std::string textOf(const lobe::ImageAttributes& attributes, const char* key) {
  const auto* text = valueOf<lobe::AttributeText>(attributes, key);
  return text ? std::string(*text) : std::string();
}

/// What makes the variances of two pictures differ, as far as their attributes say. Pictures of other programs and PNG
/// files have none.
std::vector<std::string> differencesOf(const lobe::ImageAttributes& a, const lobe::ImageAttributes& b) {
  constexpr double kEqual = 1.1;  // the ratio of numbers of samples up to which pictures may have taken equally long
  std::vector<std::string> all;
  if (a.empty() || b.empty()) return all;
  const auto *m = valueOf<double>(a, "samples"), *n = valueOf<double>(b, "samples");
  if (m && n && std::max(*m, *n) > kEqual * std::min(*m, *n)) all.push_back(fmt::format("{} and {} samples", *m, *n));
  if (textOf(a, "interrupted") != textOf(b, "interrupted"))
    all.emplace_back("different numbers of samples, because a run was interrupted");
  if (textOf(a, "gradients") != textOf(b, "gradients")) all.emplace_back("different --gradients");
  return all;
}

void noteDifferentVariances(const std::string& a, const std::string& b) {
  for (const std::string& difference : differencesOf(lobe::readAttributes(a), lobe::readAttributes(b)))
    lobe::printNote("lobecompare",
                    fmt::format("{} and {}: have {}; the result is the mean of both variances", a, b, difference));
}

void comparePair(const Arguments& arguments) {
  const std::string& name = arguments.images[0];
  const lobe::Image a = lobe::readImage(arguments.reference), b = lobe::readImage(name);
  lobe::checkDifferentSeeds(arguments.reference, name);
  noteDifferentScenes(arguments.reference, name);
  noteDifferent(arguments.reference, name, "integrator", "integrators");
  noteDifferentVariances(arguments.reference, name);
  for (const std::string& image : {arguments.reference, name}) noteMissingSamples(image);
  const lobe::PairVariance variance = measured(name, [&] { return lobe::comparePair(a, b); });
  arguments.json ? printJson(variance, arguments) : printTable(variance, arguments);
  if (!arguments.map.empty()) lobe::writeErrorMap(arguments.map, a.width, lobe::relativeVariances(a, b));
}

// ---- Agreement of two methods

/// first: the image whose size all must have; null: the first of these.
std::vector<lobe::WeightedPicture> readPictures(const std::vector<std::filesystem::path>& paths,
                                                const lobe::Image* first) {
  std::vector<lobe::WeightedPicture> pictures;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) lobe::checkDifferentSeeds(paths[j], paths[i]);
    pictures.push_back({lobe::readImage(paths[i]), lobe::samplesOf(paths[i])});
    measured(paths[i].string(), [&] { lobe::checkComparable(pictures[i].image, first ? *first : pictures[0].image); });
  }
  return pictures;
}

void printAgreement(const lobe::Agreement& a) {
  const std::string ratio = fmt::format("{:.5f} ± {:.2g}", a.meanRatio, a.meanRatioError);
  fmt::print(
      "{}: ratio of means {}, z {:.2f}; worst z {:.2f} of {} blocks of {}x{} pixels, at {},{}; "
      "limit {:.2f}\n",
      a.agree ? "agree" : "disagree", orDash(a.meanRatio, ratio), a.z, a.worstZ, a.blocks, lobe::kAgreementBlock,
      lobe::kAgreementBlock, a.worstX, a.worstY, a.limitZ);
}

/// One note is enough.
void noteScenes(const Arguments& arguments) {
  for (const auto& images : {arguments.images, arguments.others})
    for (const std::string& image : images)
      if (noteDifferentScenes(arguments.reference, image)) return;
}

void testAgreement(const Arguments& arguments) {
  const std::vector<lobe::WeightedPicture> pictures = readPictures(all(arguments), nullptr);
  const std::vector<lobe::WeightedPicture> others =
      readPictures({arguments.others.begin(), arguments.others.end()}, &pictures[0].image);
  noteScenes(arguments);
  const lobe::Agreement a = lobe::testAgreement(pictures, others);
  if (!arguments.json) return printAgreement(a);
  const nlohmann::ordered_json json{{"agree", a.agree},
                                    {"mean_ratio", a.meanRatio},
                                    {"mean_ratio_error", a.meanRatioError},
                                    {"z", a.z},
                                    {"worst_z", a.worstZ},
                                    {"limit_z", a.limitZ},
                                    {"blocks", a.blocks},
                                    {"worst_at", {a.worstX, a.worstY}}};
  fmt::print("{}\n", lobe::jsonText(json));
}

lobe::Image readReference(const Arguments& arguments) {
  const lobe::Image reference = lobe::readImage(arguments.reference);
  noteMissingSamples(arguments.reference);
  try {
    return lobe::averagedDown(reference, arguments.shrink);
  } catch (const std::runtime_error& e) {
    throw std::runtime_error(fmt::format("{}: {}", arguments.reference, e.what()));
  }
}

void merge(const Arguments& arguments) {
  const lobe::MergedImage merged = lobe::mergeImages(all(arguments));
  std::set<lobe::Aov> aovs;
  for (const auto& [aov, image] : merged.aovs) aovs.insert(aov);
  lobe::checkLossless(arguments.exr, aovs);
  lobe::OutputErrors errors;
  if (!arguments.variance.empty())
    errors.attempt(arguments.variance,
                   [&] { lobe::writeImage(arguments.variance, lobe::varianceOfMerged(all(arguments), merged.image)); });
  errors.attempt(arguments.merge, [&] {
    const std::size_t clamped =
        lobe::writeImage(arguments.merge, merged.image, merged.attributes, lobe::layersOf(merged.aovs), arguments.exr);
    lobe::noteClamped("lobecompare", arguments.merge, clamped, arguments.exr);
  });
  errors.throwIfAny();
}

void convert(const Arguments& arguments) {
  lobe::Image image = lobe::readImage(arguments.reference);
  for (lobe::Rgb& pixel : image.pixels) pixel *= std::exp2(arguments.exposure);
  lobe::writeImage(arguments.images.front(), image);
}

void run(const Arguments& arguments) {
  checkArguments(arguments);
  if (arguments.png) return convert(arguments);
  if (!arguments.merge.empty()) return merge(arguments);
  if (arguments.pair) return comparePair(arguments);
  if (!arguments.others.empty()) return testAgreement(arguments);
  const lobe::Image reference = readReference(arguments);
  std::vector<Comparison> comparisons;
  lobe::OutputErrors errors;
  for (const std::string& name : arguments.images)
    comparisons.push_back(compare(reference, name, arguments.map, errors));
  if (arguments.json)
    printJson(comparisons);
  else
    printTable(comparisons);
  errors.throwIfAny();
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  return lobe::runTool(
      "lobecompare",
      "Measures the errors of images against a reference or the variance of a pair of images, merges or converts "
      "images.",
      argc, argv, [&](CLI::App& app) { declare(app, arguments); }, [&] { run(arguments); });
}
