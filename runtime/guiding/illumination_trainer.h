#pragma once
// Trains illumination records from particles in passes (Vorba et al. 2014, Sections 4 and 5). Results depend on the
// particles, the requests and their order, but not on threads.

#include <optional>
#include <span>
#include <vector>

#include "runtime/guiding/bsdf_sampling_fraction.h"
#include "runtime/guiding/illumination_cache.h"
#include "runtime/guiding/particle_neighbours.h"
#include "runtime/guiding/point_reservoir.h"
#include "runtime/mixture/em.h"

namespace lobe {

struct TrainingOptions {
  int components = 8;          ///< Gaussians per record, 1 to 8
  int neighbours = 250;        ///< largest number of particles of each source per record and pass, ≥ 1
  float unitFraction = 0.02f;  ///< the largest radius ("unit"), as a fraction of sceneDiagonal, in (0, 1]
  int reservoir = 500;         ///< largest number of points that each record keeps for refit, ≥ 0
  float maxParallax = 5.0f;    ///< κ: largest parallax within a record's radius, in standard deviations, > 0

  /// Throws std::runtime_error that names the first field that is out of range.
  void validate() const;
};

class IlluminationTrainer {
 public:
  /// sceneDiagonal: diagonal of a box around what the camera sees in world units, > 0. kept: records of an earlier
  /// training, which stay as they are; their indices in cache() come first.
  IlluminationTrainer(const TrainingOptions& options, float sceneDiagonal, std::vector<IlluminationRecord> kept = {});

  /// Performs one pass: updates every record from the particles near it, then creates a record for each request that no
  /// record serves and that has particles near it. Sources: as for ParticleNeighbours; they may be empty. Returns the
  /// mean over the records of the log-likelihood of their particles before the update (nats, density over the disc's
  /// area), that is, for held-out particles. nullopt if no record had particles near it.
  std::optional<double> learn(std::span<const std::span<const Particle>> sources,
                              std::span<const RecordRequest> requests);

  /// Updates the records' BSDF sampling fractions. FractionSample::record must be an index into cache().
  void learnFractions(std::span<const FractionSample> samples);

  /// Creates records for requests that no record serves, without updating the existing ones.
  void fill(std::span<const std::span<const Particle>> sources, std::span<const RecordRequest> requests);

  /// Fits every record once more to the points of its reservoir.
  void refit();

  /// The records as of the last pass.
  const IlluminationCache& cache() const { return cache_; }

  float unit() const { return unit_; }
  /// The fraction of records that have seen fewer than 5 particles per component; 0 if there are no records.
  double undersampledFraction() const;

 private:
  struct Training {
    Vec3 position, normal, tangent;
    float radius;
    float distance;    // harmonic mean of the distances to the light's origin
    float irradiance;  // mean over the passes with photons since the record was created, also those without any near it
    int passes;        // number of these passes
    float likelihoodGain;
    StepwiseEm em;
    BsdfSamplingFraction fraction;
    PointReservoir reservoir;  // of the points that em was trained with

    void addIrradiance(float ofPass);
  };

  std::optional<double> updateAll(const ParticleNeighbours& neighbours);
  void makeRecords(const ParticleNeighbours& neighbours, std::span<const RecordRequest> requests);
  std::optional<Training> makeRecord(const ParticleNeighbours& neighbours, const RecordRequest& request) const;
  PointReservoir reservoirAt(const Vec3& x) const;
  void shrinkRadius(Training& record) const;
  void rebuildCache();

  TrainingOptions options_;
  float unit_;
  std::vector<IlluminationRecord> kept_;
  std::vector<Training> records_;
  IlluminationCache cache_;
};

}  // namespace lobe
