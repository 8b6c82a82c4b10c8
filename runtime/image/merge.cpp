#include "runtime/image/merge.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <tuple>

#include <fmt/format.h>

namespace lobe {
namespace {

constexpr double kLargestExact = 0x1p53;

/// An image to be merged: its attributes, samples per pixel and sample ranges.
struct Part {
  std::filesystem::path path;
  ImageAttributes attributes;
  double samples;
  std::vector<SampleRange> ranges;
};

template <class Value>
std::optional<Value> find(const ImageAttributes& attributes, const char* name) {
  const auto found = attributes.find(name);
  if (found == attributes.end()) return std::nullopt;
  const Value* value = std::get_if<Value>(&found->second);
  return value ? std::optional(*value) : std::nullopt;
}

std::optional<std::uint64_t> findCount(const ImageAttributes& attributes, const char* name) {
  const std::optional<double> value = find<double>(attributes, name);
  if (!value || !(*value >= 0 && *value <= kLargestExact) || std::floor(*value) != *value) return std::nullopt;
  return static_cast<std::uint64_t>(*value);
}

std::vector<SampleRange> parseRanges(const std::string& text) {
  std::vector<SampleRange> ranges;
  std::istringstream all(text);
  all.exceptions(std::ios::badbit);  // otherwise too little memory would look like the end of the text
  for (std::string entry; std::getline(all, entry, ',');) {
    std::istringstream words(entry);
    words.exceptions(std::ios::badbit);
    SampleRange range;
    std::string rest;
    if (!(words >> range.integrator >> range.seed >> range.first >> range.last) || words >> rest ||
        range.first >= range.last)
      throw std::runtime_error(fmt::format("the attribute sampleRanges is damaged at \"{}\"", entry));
    ranges.push_back(range);
  }
  return ranges;
}

std::string textOf(const std::vector<SampleRange>& ranges) {
  std::string text;
  for (const SampleRange& r : ranges)
    text += fmt::format("{}{} {} {} {}", text.empty() ? "" : ", ", r.integrator, r.seed, r.first, r.last);
  return text;
}

bool sameStream(const SampleRange& a, const SampleRange& b) {
  return a.integrator == b.integrator && a.seed == b.seed;
}

/// Orders ranges by their stream and, within it, by their first sample.
bool precedes(const SampleRange& a, const SampleRange& b) {
  return std::tie(a.integrator, a.seed, a.first) < std::tie(b.integrator, b.seed, b.first);
}

/// Sorts the ranges and joins adjacent ones.
std::vector<SampleRange> joined(std::vector<SampleRange> ranges) {
  std::ranges::sort(ranges, precedes);
  std::vector<SampleRange> result;
  for (const SampleRange& r : ranges)
    if (!result.empty() && sameStream(result.back(), r) && result.back().last == r.first)
      result.back().last = r.last;
    else
      result.push_back(r);
  return result;
}

std::vector<SampleRange> rangesOf(const std::filesystem::path& path, const ImageAttributes& attributes) {
  try {
    return sampleRanges(attributes);
  } catch (const std::runtime_error& e) {
    throw std::runtime_error(fmt::format("{}: {}", path.string(), e.what()));
  }
}

Part describe(const std::filesystem::path& path) {
  std::error_code error;  // of names that the system refuses, which reading reports
  if (!std::filesystem::exists(path, error) && !error) throw std::runtime_error(path.string() + ": no such file");
  Part part{path, readAttributes(path), 0, {}};
  const std::optional<std::uint64_t> samples = findCount(part.attributes, "samples");
  if (const auto interrupted = find<AttributeText>(part.attributes, "interrupted"))
    throw std::runtime_error(fmt::format(
        "{}: the run was interrupted and its pixels have {}; complete it with loberender --resume, or render it again",
        path.string(), *interrupted));
  if (!samples || *samples == 0)
    throw std::runtime_error(
        fmt::format("{}: does not say how many samples it has, as .exr files written by loberender do", path.string()));
  const auto gradients = find<AttributeText>(part.attributes, "gradients");
  if (gradients && gradients->starts_with("l1"))
    throw std::runtime_error(
        fmt::format("{}: pictures of --gradients l1 cannot be merged or tested for agreement, because their mean keeps "
                    "the bias of few samples; "
                    "render all samples in one run, or with --gradients l2",
                    path.string()));
  part.samples = static_cast<double>(*samples);
  part.ranges = rangesOf(path, part.attributes);
  return part;
}

/// Images without the attribute sceneHash are accepted.
void checkSameScene(const Part& a, const Part& b) {
  const auto one = find<AttributeText>(a.attributes, "sceneHash"),
             other = find<AttributeText>(b.attributes, "sceneHash");
  if (one && other && *one != *other)
    throw std::runtime_error(
        fmt::format("{} and {}: renders of different scenes or cameras cannot be merged (sceneHash {} and {})",
                    a.path.string(), b.path.string(), *one, *other));
}

/// A sample range and the index of the part that has it.
struct Piece {
  const SampleRange* range;
  std::size_t part;
};

[[noreturn]] void failAtOverlap(const std::vector<Part>& parts, const Piece& a, const Piece& b) {
  throw std::runtime_error(fmt::format(
      "{} and {}: both contain samples {} to {} of seed {} and integrator {}; change --sample-offset or --seed of one",
      parts[std::min(a.part, b.part)].path.string(), parts[std::max(a.part, b.part)].path.string(),
      std::max(a.range->first, b.range->first), std::min(a.range->last, b.range->last) - 1, a.range->seed,
      a.range->integrator));
}

/// Throws std::runtime_error if two parts have samples in common.
void checkDisjoint(const std::vector<Part>& parts) {
  std::vector<Piece> pieces;
  for (std::size_t i = 0; i < parts.size(); ++i)
    for (const SampleRange& range : parts[i].ranges) pieces.push_back({&range, i});
  std::ranges::sort(pieces, [](const Piece& a, const Piece& b) { return precedes(*a.range, *b.range); });
  // In this order, a range overlaps an earlier one of its stream if it overlaps the one that ends last.
  const Piece* longest = nullptr;
  for (const Piece& piece : pieces) {
    const bool sameAsBefore = longest && sameStream(*longest->range, *piece.range);
    if (sameAsBefore && longest->part != piece.part && longest->range->last > piece.range->first)
      failAtOverlap(parts, *longest, piece);
    if (!sameAsBefore || longest->range->last < piece.range->last) longest = &piece;
  }
}

ImageAttributes common(const std::vector<Part>& parts) {
  ImageAttributes result = parts.front().attributes;
  for (const Part& part : parts)
    std::erase_if(result, [&](const auto& entry) {
      const auto found = part.attributes.find(entry.first);
      return found == part.attributes.end() || found->second != entry.second;
    });
  return result;
}

/// The fraction of the light that a limit of samples has cut off (the attribute fireflyCut), for the parts together;
/// nullopt if no part has one. sums: of the pixels of each part.
std::optional<double> cutFraction(const std::vector<Part>& parts, const std::vector<double>& sums) {
  double cut = 0, all = 0;
  bool any = false;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const std::optional<double> fraction = find<double>(parts[i].attributes, "fireflyCut");
    const double kept = parts[i].samples * sums[i];
    const double before = kept / (1 - std::clamp(fraction.value_or(0), 0.0, 1 - 1e-9));
    any = any || fraction;
    cut += before - kept;
    all += before;
  }
  if (!any) return std::nullopt;
  return all > 0 ? cut / all : 0;
}

/// The fraction of the light that was added by replacing negative pixels by zero (the attribute clampedFraction of
/// pictures of --gradients), for the parts together; nullopt if no part has one.
std::optional<double> clampedFraction(const std::vector<Part>& parts, const std::vector<double>& sums) {
  double added = 0, all = 0;
  bool any = false;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const std::optional<double> fraction = find<double>(parts[i].attributes, "clampedFraction");
    any = any || fraction;
    added += parts[i].samples * sums[i] * fraction.value_or(0);
    all += parts[i].samples * sums[i];
  }
  if (!any) return std::nullopt;
  return all > 0 ? added / all : 0;
}

ImageAttributes mergedAttributes(const std::vector<Part>& parts, const std::vector<double>& sums) {
  ImageAttributes attributes = common(parts);
  for (const char* ofOne : {"sampleOffset", "sampleRanges", "seconds"}) attributes.erase(ofOne);
  if (const std::optional<double> cut = cutFraction(parts, sums)) attributes["fireflyCut"] = *cut;
  if (const std::optional<double> clamped = clampedFraction(parts, sums)) attributes["clampedFraction"] = *clamped;
  double samples = 0;
  std::vector<SampleRange> ranges;
  for (const Part& part : parts) {
    samples += part.samples;
    ranges.insert(ranges.end(), part.ranges.begin(), part.ranges.end());
  }
  ranges = joined(std::move(ranges));
  attributes["samples"] = samples;
  const bool isOne = ranges.size() == 1 && static_cast<double>(ranges[0].last - ranges[0].first) == samples;
  if (isOne)
    attributes["sampleOffset"] = static_cast<double>(ranges[0].first);
  else if (!ranges.empty())
    attributes["sampleRanges"] = textOf(ranges);
  return attributes;
}

void checkSize(const Part& part, const Image& image, const Part& first, const Image& expected) {
  if (image.width != expected.width || image.height != expected.height)
    throw std::runtime_error(fmt::format("{}: has {}x{} pixels, but {} has {}x{}", part.path.string(), image.width,
                                         image.height, first.path.string(), expected.width, expected.height));
}

/// Combines the colours and the AOVs of images, one after the other.
class Merger {
 public:
  void add(const Part& part, const Part& first) {
    const Image image = readImage(part.path);
    Aovs aovs = readAovs(part.path);
    if (samples_ == 0) start(image, aovs);
    checkSize(part, image, first, picture_);
    std::erase_if(aovs_, [&](const auto& entry) { return !aovs.contains(entry.first); });
    for (auto& [aov, sums] : aovs_) addAov(aov, aovs.at(aov), image, part.samples, sums);
    addTo(colours_, image, part.samples);
    samples_ += part.samples;
    luminances_.push_back(0);
    for (const Rgb& pixel : image.pixels) luminances_.back() += luminance(pixel);
  }

  Image image() const { return quotient(colours_, samples_); }

  Aovs aovs() const {
    Aovs all;
    for (const auto& [aov, sums] : aovs_) all.emplace(aov, quotient(sums, divisorOf(aov)));
    return all;
  }

  /// The sums of the luminances of each image.
  const std::vector<double>& luminances() const { return luminances_; }

 private:
  using Sums = std::vector<Eigen::Array3d>;

  void start(const Image& image, const Aovs& aovs) {
    picture_ = Image(image.width, image.height);
    colours_.assign(image.pixels.size(), Eigen::Array3d::Zero());
    for (const auto& entry : aovs)
      aovs_[entry.first].assign(image.pixels.size(),
                                Eigen::Array3d::Constant(entry.first == Aov::depth ? kFarthest : 0.0));
  }

  void addAov(Aov aov, const Image& values, const Image& image, double samples, Sums& sums) const {
    if (aov == Aov::variance) return addSquares(values, image, samples, sums);
    if (aov != Aov::depth) return addTo(sums, values, aov == Aov::samples ? 1.0 : samples);
    for (std::size_t i = 0; i < sums.size(); ++i) sums[i] = sums[i].min(values.pixels[i].cast<double>());
  }

  // The sums of squared deviations from the mean of all samples so far (Chan et al. 1979, "Updating Formulae and a
  // Pairwise Algorithm for Computing Sample Variances").
  void addSquares(const Image& variance, const Image& image, double samples, Sums& sums) const {
    const double between = samples_ > 0 ? samples_ * samples / (samples_ + samples) : 0.0;
    for (std::size_t i = 0; i < sums.size(); ++i) {
      sums[i] += samples * (samples - 1) * variance.pixels[i].cast<double>();
      if (between > 0) sums[i] += between * (image.pixels[i].cast<double>() - colours_[i] / samples_).square();
    }
  }

  static void addTo(Sums& sums, const Image& image, double weight) {
    for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += weight * image.pixels[i].cast<double>();
  }

  double divisorOf(Aov aov) const {
    if (aov == Aov::variance) return std::max(1.0, samples_ * (samples_ - 1));
    return aov == Aov::depth || aov == Aov::samples ? 1.0 : samples_;
  }

  Image quotient(const Sums& sums, double divisor) const {
    Image result = picture_;
    for (std::size_t i = 0; i < sums.size(); ++i) result.pixels[i] = (sums[i] / divisor).cast<float>();
    return result;
  }

  static constexpr double kFarthest = std::numeric_limits<float>::max();

  Image picture_;  // black
  Sums colours_;
  std::map<Aov, Sums> aovs_;
  double samples_ = 0;
  std::vector<double> luminances_;
};

}  // namespace

std::vector<SampleRange> sampleRanges(const ImageAttributes& attributes) {
  if (const auto text = find<AttributeText>(attributes, "sampleRanges")) return parseRanges(*text);
  const auto integrator = find<AttributeText>(attributes, "integrator");
  const auto seed = findCount(attributes, "seed"), samples = findCount(attributes, "samples");
  if (!integrator || !seed || !samples) return {};
  const std::uint64_t first = findCount(attributes, "sampleOffset").value_or(0);
  return {{*integrator, *seed, first, first + *samples}};
}

void checkDifferentSeeds(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::set<std::uint64_t> seeds;
  for (const SampleRange& range : rangesOf(a, readAttributes(a))) seeds.insert(range.seed);
  for (const SampleRange& range : rangesOf(b, readAttributes(b)))
    if (seeds.contains(range.seed))
      throw std::runtime_error(fmt::format("{} and {}: both have samples of seed {}; render one with another --seed",
                                           a.string(), b.string(), range.seed));
}

double samplesOf(const std::filesystem::path& path) {
  return describe(path).samples;
}

MergedImage mergeImages(std::span<const std::filesystem::path> paths) {
  std::vector<Part> parts;
  for (const auto& path : paths) {
    parts.push_back(describe(path));
    checkSameScene(parts.front(), parts.back());
  }
  checkDisjoint(parts);
  Merger merger;
  for (const Part& part : parts) merger.add(part, parts.front());
  return {merger.image(), mergedAttributes(parts, merger.luminances()), merger.aovs()};
}

Image varianceOfMerged(std::span<const std::filesystem::path> paths, const Image& merged) {
  if (paths.size() < 2) throw std::runtime_error("the variance of a merged image needs at least two parts");
  // Part i has the variance σ²/samples, so that Σ samples (x − mean)² / (parts − 1) is an estimate of σ².
  std::vector<Eigen::Array3d> sum(merged.pixels.size(), Eigen::Array3d::Zero());
  double samples = 0;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) checkDifferentSeeds(paths[j], paths[i]);
    const double ofPart = samplesOf(paths[i]);
    const Image image = readImage(paths[i]);
    for (std::size_t p = 0; p < sum.size(); ++p)
      sum[p] += ofPart * (image.pixels[p] - merged.pixels[p]).cast<double>().square();
    samples += ofPart;
  }
  Image variance(merged.width, merged.height);
  const double factor = 1 / (samples * (static_cast<double>(paths.size()) - 1));
  for (std::size_t p = 0; p < sum.size(); ++p) variance.pixels[p] = (factor * sum[p]).cast<float>();
  return variance;
}

}  // namespace lobe
