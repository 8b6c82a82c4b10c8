#include "runtime/guiding/illumination_trainer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <unordered_map>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <nanoflann.hpp>

namespace lobe {
namespace {

constexpr float kNeighbourNormalCosine = 0.707f;
constexpr int kUndersampledPerComponent = 5;

void require(bool condition, const char* field, const char* rule) {
  if (!condition) throw std::runtime_error(std::string("training option ") + field + ": " + rule);
}

struct ParticlePositions {
  std::span<const Particle> particles;
  // The interface nanoflann asks of a data set; its names.
  // NOLINTBEGIN(readability-identifier-naming)
  std::size_t kdtree_get_point_count() const { return particles.size(); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return particles[i].position[static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
  // NOLINTEND(readability-identifier-naming)
};

using KdTree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, ParticlePositions>,
                                                   ParticlePositions, 3, std::uint32_t>;

/// Records placed during one pass, for the question whether one of them already serves a point.
class PlacedRecords {
 public:
  explicit PlacedRecords(float cellSize) : cellSize_(cellSize) {}

  void add(const Vec3& x, const Vec3& n, float radius) { cells_[key(cell(x))].push_back({x, n, radius}); }

  bool serves(const Vec3& x, const Vec3& n) const {
    const Eigen::Vector3i centre = cell(x);
    for (int i = 0; i < 27; ++i) {
      const auto found = cells_.find(key(centre + Eigen::Vector3i(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1)));
      if (found == cells_.end()) continue;
      for (const Placed& p : found->second)
        if ((p.x - x).squaredNorm() <= p.radius * p.radius && p.n.dot(n) >= kNeighbourNormalCosine) return true;
    }
    return false;
  }

 private:
  struct Placed {
    Vec3 x, n;
    float radius;
  };
  Eigen::Vector3i cell(const Vec3& x) const { return (x / cellSize_).array().floor().cast<int>(); }
  static std::uint64_t key(const Eigen::Vector3i& c) {
    return static_cast<std::uint32_t>(c.x()) * 73856093ull ^ static_cast<std::uint32_t>(c.y()) * 19349663ull << 16 ^
           static_cast<std::uint32_t>(c.z()) * 83492791ull << 32;
  }
  float cellSize_;
  std::unordered_map<std::uint64_t, std::vector<Placed>> cells_;
};

}  // namespace

void TrainingOptions::validate() const {
  require(components >= 1 && components <= kMaxIlluminationComponents / 2, "components", "1 to 8");
  require(neighbours >= 1, "neighbours", "at least 1");
  require(unitShare > 0 && unitShare <= 1, "unit-share", "over 0 and at most 1");
  require(klThreshold > 0, "kl-threshold", "over 0");
}

/// The particles of a pass, found by position.
class IlluminationTrainer::Neighbours {
 public:
  Neighbours(std::span<const Particle> particles, int count, float maxDistance)
      : positions_{particles}, count_(count), maxDistance_(maxDistance), tree_(3, positions_, {10}) {}

  /// What the neighbours of a point say: disc points in the frame given, the distance of the farthest and the harmonic
  /// mean of the distances that the light came from (+infinity when all comes from the environment).
  struct Found {
    std::vector<WeightedPoint> points;
    float radius = 0;
    float distance = std::numeric_limits<float>::infinity();
  };

  Found around(const Vec3& x, const Vec3& n, const Vec3& tangent) const {
    std::vector<std::uint32_t> indices(count_);
    std::vector<float> distances2(count_);
    nanoflann::KNNResultSet<float, std::uint32_t> nearest(count_);
    nearest.init(indices.data(), distances2.data());
    // The set's worst distance is its last entry: filled beforehand, it bounds the search from the start.
    distances2.back() = maxDistance_ * maxDistance_;
    tree_.findNeighbors(nearest, x.data(), nanoflann::SearchParams());

    Found found;
    const Vec3 bitangent = n.cross(tangent);
    double weight = 0, inverseDistance = 0;
    for (std::size_t i = 0; i < nearest.size(); ++i) {
      const Particle& p = positions_.particles[indices[i]];
      const float cosine = p.direction.dot(n);
      if (p.normal.dot(n) < kNeighbourNormalCosine || cosine <= 0) continue;
      found.points.push_back({toDisc({p.direction.dot(tangent), p.direction.dot(bitangent), cosine}), p.weight});
      found.radius = std::max(found.radius, std::sqrt(distances2[i]));
      weight += p.weight;
      inverseDistance += p.weight / p.distance;
    }
    if (inverseDistance > 0) found.distance = static_cast<float>(weight / inverseDistance);
    return found;
  }

 private:
  ParticlePositions positions_;
  std::size_t count_;
  float maxDistance_;
  KdTree tree_;
};

IlluminationTrainer::IlluminationTrainer(const TrainingOptions& options, float sceneDiagonal)
    : options_(options), unit_(options.unitShare * sceneDiagonal) {
  options.validate();
}

void IlluminationTrainer::learn(std::span<const Particle> particles, std::span<const RecordRequest> requests) {
  if (particles.empty()) return;
  const Neighbours neighbours(particles, options_.neighbours, unit_);
  updateAll(neighbours);
  makeRecords(neighbours, requests);
}

void IlluminationTrainer::fill(std::span<const Particle> particles, std::span<const RecordRequest> requests) {
  if (particles.empty()) return;
  makeRecords(Neighbours(particles, options_.neighbours, unit_), requests);
}

void IlluminationTrainer::updateAll(const Neighbours& neighbours) {
  tbb::parallel_for(std::size_t{0}, records_.size(), [&](std::size_t i) {
    Training& record = records_[i];
    const auto found = neighbours.around(record.position, record.normal, record.tangent);
    if (found.points.empty()) return;
    record.em.update(found.points);
    shrinkRadius(record);
  });
}

void IlluminationTrainer::place(const Neighbours& neighbours, std::span<const RecordRequest> requests) {
  PlacedRecords placed(unit_);
  for (const RecordRequest& request : requests) {
    if (cache_.find(request.position, request.normal) || placed.serves(request.position, request.normal)) continue;
    const Vec3 tangent = request.normal.unitOrthogonal();
    const auto found = neighbours.around(request.position, request.normal, tangent);
    if (found.points.empty()) continue;
    const float radius = std::clamp(found.radius, 0.1f * unit_, unit_);
    placed.add(request.position, request.normal, radius);
    records_.push_back({request.position, request.normal, tangent, radius, found.distance,
                        StepwiseEm(options_.components, options_.em)});
  }
}

void IlluminationTrainer::makeRecords(const Neighbours& neighbours, std::span<const RecordRequest> requests) {
  const std::size_t first = records_.size();
  place(neighbours, requests);
  tbb::parallel_for(first, records_.size(), [&](std::size_t i) {
    Training& record = records_[i];
    record.em.fit(neighbours.around(record.position, record.normal, record.tangent).points);
    shrinkRadius(record);
  });
  rebuildCache();
}

void IlluminationTrainer::shrinkRadius(Training& record) const {
  // A receiver moved sideways by R sees a source at distance d turned by about atan(R/d); a component may turn by κ
  // standard deviations of its narrowest axis (training notes, "Validity radius").
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
  for (std::size_t i = 0; i < records_.size(); ++i) {
    const Training& t = records_[i];
    IlluminationRecord& r = records[i];
    r.position = t.position;
    r.normal = t.normal;
    r.tangent = t.tangent;
    r.radius = t.radius;
    r.background = t.em.background();
    r.samples = static_cast<float>(t.em.samplesSeen());
    r.count = static_cast<std::int32_t>(t.em.gaussians().size());
    std::ranges::copy(t.em.gaussians(), r.components.begin());
  }
  cache_ = IlluminationCache(std::move(records), unit_);
}

double IlluminationTrainer::undersampledShare() const {
  if (records_.empty()) return 0;
  const int limit = kUndersampledPerComponent * options_.components;
  const auto few = std::ranges::count_if(records_, [&](const Training& t) { return t.em.samplesSeen() < limit; });
  return static_cast<double>(few) / static_cast<double>(records_.size());
}

}  // namespace lobe
