#include "runtime/render/integrators/sample_counts.h"

#include <algorithm>
#include <cmath>

namespace lobe {
namespace {

// Bounds of the counts. Moments are learnt from few samples and may be far too low or too high.
constexpr float kLeastCount = 0.1f;
constexpr float kMostDirect = 4.0f, kMostContinued = 8.0f;
// Largest contribution of a sample that enters the moments, relative to the estimate of the reflected radiance. A rare
// path of high contribution would otherwise decide the counts of its records.
constexpr double kLargestContribution = 10;
// The mean of all records counts as this many samples of each.
constexpr double kPriorSamples = 16;
// The least reference, relative to the mean of the picture.
constexpr double kDarkest = 0.1;
// The part of the second moment that is always taken for variance: counts must be finite in scenes without noise.
constexpr double kLeastVariance = 0.05;

/// A vertex of the log, with contributions relative to its estimate.
struct Sample {
  double direct, continued;
  double directCost, continuedCost;
};

Sample sampleOf(const PathLog::Vertex& vertex, const PathLog::Path& path) {
  const double unit = 1 / (static_cast<double>(vertex.throughput) * vertex.estimate.reflectedRadiance);
  return {std::min(kLargestContribution, (vertex.radianceDirect - vertex.radianceBefore) * unit),
          std::min(kLargestContribution, (path.radiance - vertex.radianceDirect) * unit),
          vertex.costDirect - vertex.costBefore, path.cost - vertex.costDirect};
}

}  // namespace

void PathLog::append(const PathLog& other) {
  const std::size_t offset = vertices.size();
  vertices.insert(vertices.end(), other.vertices.begin(), other.vertices.end());
  for (const Path& path : other.paths) paths.push_back({offset + path.end, path.radiance, path.cost});
}

struct SampleCountModel::Sums {
  struct Estimator {
    double first = 0, second = 0, cost = 0;
    void add(double value, double spent) {
      first += value;
      second += value * value;
      cost += spent;
    }
    void add(const Estimator& other, double weight) {
      first += weight * other.first;
      second += weight * other.second;
      cost += weight * other.cost;
    }
  };
  double samples = 0;
  Estimator direct, continued;

  void add(const Sample& sample) {
    samples += 1;
    direct.add(sample.direct, sample.directCost);
    continued.add(sample.continued, sample.continuedCost);
  }
  void add(const Sums& other, double weight) {
    samples += weight * other.samples;
    direct.add(other.direct, weight);
    continued.add(other.continued, weight);
  }
  double mean() const { return (direct.first + continued.first) / samples; }
};

float SampleCountModel::Factor::count(float ratio) const {
  if (ratio * splitting > 1) return ratio * splitting;
  return std::min(1.0f, ratio * roulette);
}

SampleCountModel::Factors SampleCountModel::factorsOf(const Sums& sums, double scale) {
  const auto factor = [&](const Sums::Estimator& estimator) {
    // An estimator costs at least one shadow ray.
    const double cost = std::max(estimator.cost / sums.samples, 0.5);
    const double mean = estimator.first / sums.samples, second = estimator.second / sums.samples;
    return Factor{static_cast<float>(scale * std::sqrt(std::max(0.0, second - mean * mean) / cost)),
                  static_cast<float>(scale * std::sqrt(second / cost))};
  };
  return {factor(sums.direct), factor(sums.continued)};
}

SampleCountModel::SampleCountModel(const PathLog& log, std::size_t records) : factors_(records) {
  if (log.vertices.empty()) return;
  std::vector<Sums> ofRecord(records);
  Sums all;
  double radiance = 0, cost = 0;
  std::size_t begin = 0;
  for (const PathLog::Path& path : log.paths) {
    radiance += path.radiance;
    cost += path.cost;
    for (std::size_t i = begin; i < path.end; ++i) {
      const Sample sample = sampleOf(log.vertices[i], path);
      ofRecord[log.vertices[i].estimate.record].add(sample);
      all.add(sample);
    }
    begin = path.end;
  }
  const auto paths = static_cast<double>(log.paths.size());
  leastReference_ = static_cast<float>(kDarkest * radiance / paths);
  for (Sums& sums : ofRecord) sums.add(all, kPriorSamples / all.samples);

  // The relative variance of the picture: that of the first vertices, whose records estimate the means.
  double second = 0, squaredMeans = 0, firsts = 0;
  begin = 0;
  for (const PathLog::Path& path : log.paths) {
    if (begin < path.end) {
      const PathLog::Vertex& vertex = log.vertices[begin];
      const float expected = vertex.throughput * vertex.estimate.reflectedRadiance;
      const double ratio = expected / reference(expected);
      const Sample sample = sampleOf(vertex, path);
      second += std::pow(ratio * (sample.direct + sample.continued), 2);
      squaredMeans += std::pow(ratio * ofRecord[vertex.estimate.record].mean(), 2);
      firsts += 1;
    }
    begin = path.end;
  }
  const double variance = std::max(kLeastVariance * second, second - squaredMeans) / firsts;
  const double scale = variance > 0 ? std::sqrt(cost / paths / variance) : 0;
  std::ranges::transform(ofRecord, factors_.begin(), [&](const Sums& sums) { return factorsOf(sums, scale); });
}

SampleCounts SampleCountModel::counts(std::uint32_t record, float ratio) const {
  const Factors& factors = factors_[record];
  return {std::clamp(factors.direct.count(ratio), kLeastCount, kMostDirect),
          std::clamp(factors.continued.count(ratio), kLeastCount, kMostContinued)};
}

}  // namespace lobe
