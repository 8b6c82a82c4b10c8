#include "runtime/guiding/illumination_trainer.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "runtime/core/parallel.h"
#include "runtime/guiding/request_cubes.h"

namespace lobe {
namespace {

constexpr float kNeighbourNormalCosine = 0.707f;
constexpr int kUndersampledPerComponent = 5;
// Radius, in units, within which further requests are dropped after a request that found no particle.
constexpr float kEmptySpacing = 0.3f;

void require(bool condition, const char* field, const char* rule) {
  if (!condition) throw std::runtime_error(std::string("training option ") + field + " must be " + rule);
}

/// This mean log-likelihood less that of cosine-weighted sampling; 0 if one of them is not finite.
float likelihoodGain(double likelihood, std::span<const WeightedPoint> points) {
  const double gain = likelihood - meanLogLikelihood(points, {}, 1);
  return std::isfinite(gain) ? static_cast<float>(gain) : 0;
}

/// A point where a record was created, or where none could be.
struct Placed {
  Vec3 position, normal;
  float radius;  // within which requests of similar normals are dropped

  bool serves(const RecordRequest& r) const {
    return normal.dot(r.normal) >= kNeighbourNormalCosine && (position - r.position).squaredNorm() <= radius * radius;
  }
};

}  // namespace

void TrainingOptions::validate() const {
  require(components >= 1 && components <= kMaxLightComponents, "components", "from 1 to 8");
  require(neighbours >= 1, "neighbours", "at least 1");
  require(reservoir >= 0, "reservoir", "at least 0");
  require(unitFraction > 0 && unitFraction <= 1, "unitFraction", "in (0, 1]");
  require(maxParallax > 0, "maxParallax", "positive");
}

IlluminationTrainer::IlluminationTrainer(const TrainingOptions& options, float sceneDiagonal,
                                         std::vector<IlluminationRecord> kept)
    : options_(options), unit_(options.unitFraction * sceneDiagonal), kept_(std::move(kept)) {
  options.validate();
  for (const IlluminationRecord& record : kept_) unit_ = std::max(unit_, record.radius);
  if (!kept_.empty()) rebuildCache();
}

std::optional<double> IlluminationTrainer::learn(std::span<const std::span<const Particle>> sources,
                                                 std::span<const RecordRequest> requests) {
  const ParticleNeighbours neighbours(sources, options_.neighbours, unit_);
  if (neighbours.empty()) {
    if (!records_.empty()) rebuildCache();  // fractions may have been learnt
    return std::nullopt;
  }
  const std::optional<double> likelihood = updateAll(neighbours);
  makeRecords(neighbours, requests);
  return likelihood;
}

void IlluminationTrainer::fill(std::span<const std::span<const Particle>> sources,
                               std::span<const RecordRequest> requests) {
  const ParticleNeighbours neighbours(sources, options_.neighbours, unit_);
  if (!neighbours.empty()) makeRecords(neighbours, requests);
}

void IlluminationTrainer::Training::addIrradiance(float ofPass) {
  ++passes;
  irradiance += (ofPass - irradiance) / static_cast<float>(passes);
}

void IlluminationTrainer::learnFractions(std::span<const FractionSample> samples) {
  std::vector<std::vector<FractionSample>> ofRecord(records_.size());
  for (const FractionSample& s : samples) {
    const std::size_t index = s.record - kept_.size();  // huge for records that are kept
    if (s.record >= kept_.size() && index < records_.size()) ofRecord[index].push_back(s);  // others: another field's
  }
  parallelFor(std::size_t{0}, records_.size(), [&](std::size_t i) { records_[i].fraction.learn(ofRecord[i]); });
}

std::optional<double> IlluminationTrainer::updateAll(const ParticleNeighbours& neighbours) {
  constexpr double none = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> likelihoods(records_.size(), none);
  parallelFor(std::size_t{0}, records_.size(), [&](std::size_t i) {
    Training& record = records_[i];
    const Neighbourhood found = neighbours.around(record.position, record.normal, record.tangent);
    if (neighbours.carryFlux()) record.addIrradiance(found.irradiance);
    if (found.points.empty()) return;
    likelihoods[i] = meanLogLikelihood(found.points, record.em.gaussians(), record.em.background());
    record.likelihoodGain = likelihoodGain(likelihoods[i], found.points);
    record.em.update(found.points);
    record.reservoir.add(found.points);
    shrinkRadius(record);
  });
  double sum = 0;
  long count = 0;
  for (const double value : likelihoods)
    if (std::isfinite(value)) sum += value, ++count;
  if (count == 0) return std::nullopt;
  return sum / static_cast<double>(count);
}

// Processes the requests of each cube in their order. The edge of a cube is the largest radius, so that records do not
// serve requests in other cubes of the same parity, and these can be processed in parallel.
void IlluminationTrainer::makeRecords(const ParticleNeighbours& neighbours, std::span<const RecordRequest> requests) {
  const RequestCubes cubes(requests, unit_,
                           [this](const RecordRequest& r) { return !cache_.find(r.position, r.normal); });
  std::vector<std::vector<Placed>> placed(cubes.size());
  std::vector<std::vector<Training>> made(cubes.size());
  const auto process = [&](std::size_t cube) {
    std::vector<Placed> near;
    for (const std::size_t other : cubes.around(cube))
      near.insert(near.end(), placed[other].begin(), placed[other].end());
    for (const std::uint32_t i : cubes.requests(cube)) {
      const RecordRequest& request = requests[i];
      if (std::ranges::any_of(near, [&](const Placed& p) { return p.serves(request); })) continue;
      std::optional<Training> record = makeRecord(neighbours, request);
      // If there is no particle, requests nearby are unlikely to find any.
      near.push_back({request.position, request.normal, record ? record->radius : kEmptySpacing * unit_});
      placed[cube].push_back(near.back());
      if (record) made[cube].push_back(std::move(*record));
    }
  };
  for (int parity = 0; parity < RequestCubes::kParities; ++parity) {
    const std::vector<std::size_t> apart = cubes.ofParity(parity);
    parallelFor(std::size_t{0}, apart.size(), [&](std::size_t i) { process(apart[i]); });
  }
  for (std::vector<Training>& records : made) std::ranges::move(records, std::back_inserter(records_));
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
                  0,
                  0,
                  0,
                  StepwiseEm(options_.components),
                  {},
                  reservoirAt(request.position)};
  if (neighbours.carryFlux()) record.addIrradiance(found.irradiance);
  record.em.fit(found.points);
  record.reservoir.add(found.points);
  shrinkRadius(record);
  return record;
}

// The random numbers follow from the position, so that they do not depend on threads.
PointReservoir IlluminationTrainer::reservoirAt(const Vec3& x) const {
  const auto bits = [&](int axis) { return std::bit_cast<std::uint32_t>(x[axis]); };
  return {static_cast<std::size_t>(options_.reservoir), bits(0), bits(1), bits(2)};
}

void IlluminationTrainer::refit() {
  if (options_.reservoir == 0) return;
  parallelFor(std::size_t{0}, records_.size(), [&](std::size_t i) {
    records_[i].em.refit(records_[i].reservoir.points());
    shrinkRadius(records_[i]);
  });
  rebuildCache();
}

void IlluminationTrainer::shrinkRadius(Training& record) const {
  // For a receiver that moves sideways by R, the direction to a source at distance d turns by about atan(R/d). A
  // component may turn by κ standard deviations of its narrowest axis.
  double inverse = 0;
  for (const Gaussian& g : record.em.gaussians()) {
    const double half = 0.5 * (g.cov.xx + g.cov.yy);
    const double smallest = half - std::sqrt(std::max(0.0, half * half - g.cov.determinant()));
    const double cosine = std::clamp(1.0 - options_.maxParallax * std::sqrt(std::max(0.0, smallest)), 0.01, 0.99999);
    inverse += g.weight * cosine / std::sqrt(1.0 - cosine * cosine);
  }
  const auto parallax = static_cast<float>(record.distance / inverse);
  const float allowed = std::max({parallax, 0.5f * record.radius, 0.1f * unit_});
  record.radius = std::min(record.radius, allowed);
}

void IlluminationTrainer::rebuildCache() {
  std::vector<IlluminationRecord> records = kept_;
  records.resize(kept_.size() + records_.size());
  parallelFor(std::size_t{0}, records_.size(), [&](std::size_t i) {
    const Training& t = records_[i];
    IlluminationRecord& r = records[kept_.size() + i];
    r.position = t.position;
    r.normal = t.normal;
    r.tangent = t.tangent;
    r.radius = t.radius;
    r.background = t.em.background();
    r.irradiance = t.irradiance;
    r.samples = static_cast<float>(t.em.samplesSeen());
    r.bsdfFraction = t.fraction.bsdf();
    r.likelihoodGain = t.likelihoodGain;
    r.count = static_cast<std::int32_t>(t.em.gaussians().size());
    std::ranges::copy(t.em.gaussians(), r.components.begin());
  });
  cache_ = IlluminationCache(records, unit_);
}

double IlluminationTrainer::undersampledFraction() const {
  const std::size_t all = kept_.size() + records_.size();
  if (all == 0) return 0;
  const auto limit = static_cast<float>(kUndersampledPerComponent * options_.components);
  const auto few = std::ranges::count_if(
                       records_, [&](const Training& t) { return static_cast<float>(t.em.samplesSeen()) < limit; }) +
                   std::ranges::count_if(kept_, [&](const IlluminationRecord& r) { return r.samples < limit; });
  return static_cast<double>(few) / static_cast<double>(all);
}

}  // namespace lobe
