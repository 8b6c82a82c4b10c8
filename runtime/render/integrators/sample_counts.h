#pragma once
// Efficiency-aware Russian roulette and splitting (Rath et al. 2022, "EARS: Efficiency-Aware Russian Roulette and
// Splitting"): how many samples of next-event estimation, and how many continuations, a path takes at a vertex.
//
// A path of throughput T that takes n samples of an estimator with variance V and cost C at a vertex adds T² V / n to
// the variance of the pixel and n C to its cost. The product of the two, over the whole picture, is least for
//
//   n = T / I · sqrt(V / C) · sqrt(C̄ / V̄),
//
// where I is the value of the pixel, V̄ the mean relative variance of the picture's samples and C̄ their mean cost. For
// n < 1, which is Russian roulette, the second moment takes the place of V (Rath et al. 2022, Section 4.2). Next-event
// estimation and the continuation of the path have counts of their own. Their moments and costs are learnt for each
// illumination record, relative to the record's estimate of the reflected radiance, from paths traced in advance.
//
// Estimates are unbiased for any counts: contributions are divided by the expected count.

#include <cstddef>
#include <cstdint>
#include <vector>

namespace lobe {

/// Expected numbers of samples at a vertex, > 0. Below 1 they are probabilities.
struct SampleCounts {
  float direct = 1;     ///< of next-event estimation
  float continued = 1;  ///< of directions in which the path continues
};

/// What is known about a vertex before it is sampled.
struct VertexEstimate {
  float reflectedRadiance;  ///< luminance, towards wo, in units that all vertices share
  std::uint32_t record;     ///< index of the illumination record that serves the vertex
};

/// Paths whose counts were 1 at every vertex, in the order in which they were traced. Luminances; costs as from
/// PathStatistics::cost.
struct PathLog {
  struct Vertex {
    VertexEstimate estimate;  ///< reflectedRadiance > 0
    float throughput;         ///< of the path that arrives, > 0
    float radianceBefore;     ///< found by the path before it scattered at the vertex
    float radianceDirect;     ///< found after next-event estimation at the vertex
    float costBefore, costDirect;
  };
  struct Path {
    std::size_t end;  ///< number of vertices of this and all earlier paths
    float radiance, cost;
  };
  std::vector<Vertex> vertices;
  std::vector<Path> paths;

  void append(const PathLog& other);
};

class SampleCountModel {
 public:
  /// Learns from a log. records: number of illumination records, greater than every index in the log.
  SampleCountModel(const PathLog& log, std::size_t records);

  /// The value that stands for the pixel, for a path whose expected contribution (throughput times reflected radiance)
  /// is `first` at its first vertex with an estimate. It is bounded from below, because errors of dark pixels are
  /// hardly visible.
  float reference(float first) const { return first > leastReference_ ? first : leastReference_; }

  /// Counts at a vertex. ratio: the expected contribution over the reference, ≥ 0.
  SampleCounts counts(std::uint32_t record, float ratio) const;

 private:
  // The count for a ratio of 1: splitting, from the variance, if the result is above one; otherwise roulette, from the
  // second moment.
  struct Factor {
    float splitting = 1, roulette = 1;
    float count(float ratio) const;
  };
  struct Factors {
    Factor direct, continued;
  };
  struct Sums;
  static Factors factorsOf(const Sums& sums, double scale);

  std::vector<Factors> factors_;  // by record
  float leastReference_ = 0;
};

}  // namespace lobe
