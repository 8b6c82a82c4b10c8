#include "runtime/guiding/illumination_trainer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <unordered_map>

#include "runtime/core/parallel.h"

namespace lobe {
namespace {

constexpr float kNeighbourNormalCosine = 0.707f;
constexpr int kUndersampledPerComponent = 5;
// Smallest distance, in units, of records that are created in the same round. Records that are closer may serve each
// other's request, and a fit that is discarded wastes time: in the kitchen scene, four of five fits at a distance of
// 0.3 and one of twenty at 1.
constexpr float kRoundSpacing = 1.0f;
// Radius, in units, within which further requests are dropped after a request that found no particle.
constexpr float kEmptySpacing = 0.3f;

void require(bool condition, const char* field, const char* rule) {
  if (!condition) throw std::runtime_error(std::string("training option ") + field + " must be " + rule);
}

/// A hash grid of points with normals, for queries of the points near a position.
template <class Value>
class PointGrid {
 public:
  explicit PointGrid(float cellSize) : cellSize_(cellSize) {}

  void add(const Vec3& x, const Vec3& n, const Value& value) { cells_[key(cell(x))].push_back({x, n, value}); }

  /// Whether f(distance², value) is true for a point with a normal within 45° of n. Finds all points that are closer
  /// than the size of a cell.
  template <class Predicate>
  bool any(const Vec3& x, const Vec3& n, const Predicate& f) const {
    const Eigen::Vector3i centre = cell(x);
    for (int i = 0; i < 27; ++i) {
      const auto found = cells_.find(key(centre + Eigen::Vector3i(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1)));
      if (found == cells_.end()) continue;
      for (const Entry& e : found->second)
        if (e.n.dot(n) >= kNeighbourNormalCosine && f((e.x - x).squaredNorm(), e.value)) return true;
    }
    return false;
  }

 private:
  struct Entry {
    Vec3 x, n;
    Value value;
  };
  Eigen::Vector3i cell(const Vec3& x) const { return (x / cellSize_).array().floor().cast<int>(); }
  static std::uint64_t key(const Eigen::Vector3i& c) {
    return static_cast<std::uint32_t>(c.x()) * 73856093ull ^ static_cast<std::uint32_t>(c.y()) * 19349663ull << 16 ^
           static_cast<std::uint32_t>(c.z()) * 83492791ull << 32;
  }
  float cellSize_;
  std::unordered_map<std::uint64_t, std::vector<Entry>> cells_;
};

/// Moves requests out of `waiting`, in order, such that they are farther from one another than the distance.
std::vector<RecordRequest> takeApart(std::vector<RecordRequest>& waiting, float distance) {
  PointGrid<char> grid(distance);
  std::vector<RecordRequest> taken, left;
  for (const RecordRequest& r : waiting) {
    const bool close = grid.any(r.position, r.normal, [&](float d2, char) { return d2 <= distance * distance; });
    (close ? left : taken).push_back(r);
    if (!close) grid.add(r.position, r.normal, 0);
  }
  waiting = std::move(left);
  return taken;
}

}  // namespace

void TrainingOptions::validate() const {
  require(components >= 1 && components <= kMaxIlluminationComponents / 2, "components", "from 1 to 8");
  require(neighbours >= 1, "neighbours", "at least 1");
  require(unitFraction > 0 && unitFraction <= 1, "unitFraction", "in (0, 1]");
  require(klThreshold > 0, "klThreshold", "positive");
}

IlluminationTrainer::IlluminationTrainer(const TrainingOptions& options, float sceneDiagonal)
    : options_(options), unit_(options.unitFraction * sceneDiagonal) {
  options.validate();
}

std::optional<double> IlluminationTrainer::learn(std::span<const std::span<const Particle>> sources,
                                                 std::span<const RecordRequest> requests) {
  const ParticleNeighbours neighbours(sources, options_.neighbours, unit_);
  if (neighbours.empty()) return std::nullopt;
  const std::optional<double> likelihood = updateAll(neighbours);
  makeRecords(neighbours, requests);
  return likelihood;
}

void IlluminationTrainer::fill(std::span<const std::span<const Particle>> sources,
                               std::span<const RecordRequest> requests) {
  const ParticleNeighbours neighbours(sources, options_.neighbours, unit_);
  if (!neighbours.empty()) makeRecords(neighbours, requests);
}

void IlluminationTrainer::learnFractions(std::span<const FractionSample> samples) {
  std::vector<std::vector<FractionSample>> ofRecord(records_.size());
  for (const FractionSample& s : samples)
    if (s.record < records_.size()) ofRecord[s.record].push_back(s);  // other samples belong to another field
  parallelFor(std::size_t{0}, records_.size(), [&](std::size_t i) { records_[i].fraction.learn(ofRecord[i]); });
}

std::optional<double> IlluminationTrainer::updateAll(const ParticleNeighbours& neighbours) {
  constexpr double none = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> likelihoods(records_.size(), none);
  parallelFor(std::size_t{0}, records_.size(), [&](std::size_t i) {
    Training& record = records_[i];
    const Neighbourhood found = neighbours.around(record.position, record.normal, record.tangent);
    if (found.points.empty()) return;
    likelihoods[i] = meanLogLikelihood(found.points, record.em.gaussians(), record.em.background());
    record.em.update(found.points);
    ++record.passes;
    record.irradiance += (found.irradiance - record.irradiance) / static_cast<float>(record.passes);
    shrinkRadius(record);
  });
  double sum = 0;
  long count = 0;
  for (const double value : likelihoods)
    if (std::isfinite(value)) sum += value, ++count;
  if (count == 0) return std::nullopt;
  return sum / static_cast<double>(count);
}

// Processes the requests in their order, but in parallel rounds of requests that are far enough from one another. A new
// record whose request is already served by an earlier record is discarded, so that the result is the same as when the
// requests are processed one at a time.
void IlluminationTrainer::makeRecords(const ParticleNeighbours& neighbours, std::span<const RecordRequest> requests) {
  PointGrid<float> placed(unit_);  // values: radii
  const auto isServed = [&](const RecordRequest& r) {
    return placed.any(r.position, r.normal, [](float d2, float radius) { return d2 <= radius * radius; });
  };
  std::vector<RecordRequest> waiting;
  for (const RecordRequest& request : requests)
    if (!cache_.find(request.position, request.normal)) waiting.push_back(request);
  while (!waiting.empty()) {
    std::erase_if(waiting, isServed);
    const std::vector<RecordRequest> round = takeApart(waiting, kRoundSpacing * unit_);
    std::vector<std::optional<Training>> made(round.size());
    parallelFor(std::size_t{0}, round.size(), [&](std::size_t i) { made[i] = makeRecord(neighbours, round[i]); });
    for (std::size_t i = 0; i < round.size(); ++i) {
      if (isServed(round[i])) continue;
      // If there is no particle, requests nearby are unlikely to find any.
      placed.add(round[i].position, round[i].normal, made[i] ? made[i]->radius : kEmptySpacing * unit_);
      if (made[i]) records_.push_back(std::move(*made[i]));
    }
  }
  rebuildCache();
}

std::optional<IlluminationTrainer::Training> IlluminationTrainer::makeRecord(const ParticleNeighbours& neighbours,
                                                                             const RecordRequest& request) const {
  const Vec3 tangent = request.normal.unitOrthogonal();
  const Neighbourhood found = neighbours.around(request.position, request.normal, tangent);
  if (found.points.empty()) return std::nullopt;
  Training record{request.position,
                  request.normal,
                  tangent,
                  std::clamp(found.radius, 0.1f * unit_, unit_),
                  found.distance,
                  found.irradiance,
                  1,
                  StepwiseEm(options_.components),
                  {}};
  record.em.fit(found.points);
  shrinkRadius(record);
  return record;
}

void IlluminationTrainer::shrinkRadius(Training& record) const {
  // For a receiver that moves sideways by R, the direction to a source at distance d turns by about atan(R/d). A
  // component may turn by κ standard deviations of its narrowest axis.
  double inverse = 0;
  for (const Gaussian& g : record.em.gaussians()) {
    const double half = 0.5 * (g.cov.xx + g.cov.yy);
    const double smallest = half - std::sqrt(std::max(0.0, half * half - g.cov.determinant()));
    const double cosine = std::clamp(1.0 - options_.klThreshold * std::sqrt(std::max(0.0, smallest)), 0.01, 0.99999);
    inverse += g.weight * cosine / std::sqrt(1.0 - cosine * cosine);
  }
  const auto parallax = static_cast<float>(record.distance / inverse);
  const float allowed = std::max({parallax, 0.5f * record.radius, 0.1f * unit_});
  record.radius = std::min(record.radius, allowed);
}

void IlluminationTrainer::rebuildCache() {
  std::vector<IlluminationRecord> records(records_.size());
  parallelFor(std::size_t{0}, records_.size(), [&](std::size_t i) {
    const Training& t = records_[i];
    IlluminationRecord& r = records[i];
    r.position = t.position;
    r.normal = t.normal;
    r.tangent = t.tangent;
    r.radius = t.radius;
    r.background = t.em.background();
    r.irradiance = t.irradiance;
    r.samples = static_cast<float>(t.em.samplesSeen());
    r.bsdfFraction = t.fraction.bsdf();
    r.count = static_cast<std::int32_t>(t.em.gaussians().size());
    std::ranges::copy(t.em.gaussians(), r.components.begin());
  });
  cache_ = IlluminationCache(records, unit_);
}

double IlluminationTrainer::undersampledFraction() const {
  if (records_.empty()) return 0;
  const int limit = kUndersampledPerComponent * options_.components;
  const auto few = std::ranges::count_if(records_, [&](const Training& t) { return t.em.samplesSeen() < limit; });
  return static_cast<double>(few) / static_cast<double>(records_.size());
}

}  // namespace lobe
