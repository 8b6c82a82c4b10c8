#pragma once
// Trains illumination records from particles, pass by pass (Vorba et al. 2014, Sections 4 and 5).
//
// Results depend on the particles, the requests and their order, never on threads: records are placed one after another
// in the order of the requests, and each is fitted by itself.

#include <optional>
#include <span>
#include <vector>

#include "runtime/guiding/bsdf_sampling_fraction.h"
#include "runtime/guiding/illumination_cache.h"
#include "runtime/guiding/particle_neighbours.h"
#include "runtime/mixture/em.h"

namespace lobe {

struct TrainingOptions {
  int components = 8;          ///< Gaussians a record, 1 to 8
  int neighbours = 250;        ///< particles of each source that a record is updated from, at most
  float unitFraction = 0.02f;  ///< the length u, as a share of the scene's bounding-box diagonal
  float klThreshold = 5.0f;    ///< κ, how far in standard deviations a component may move before a record is invalid

  /// Throws std::runtime_error that names the field.
  void validate() const;
};

class IlluminationTrainer {
 public:
  /// sceneDiagonal: of the bounding box, world units, > 0.
  IlluminationTrainer(const TrainingOptions& options, float sceneDiagonal);

  /// One pass: updates every record from the particles around it, then makes a record for each request that no record
  /// serves yet and that has particles around it. Sources: as ParticleNeighbours; empty ones are fine. Returns the mean
  /// over the records of log p(particle) (nats, over the disc's area) as it was before they were learnt from: a measure
  /// on particles held out. nullopt: no record has met a particle.
  std::optional<double> learn(std::span<const std::span<const Particle>> sources,
                              std::span<const RecordRequest> requests);

  /// Learns the records' shares of the BSDF. The samples are of records in cache() as it is.
  void learnFractions(std::span<const FractionSample> samples);

  /// Makes records for requests that none serves from particles that the others have already learnt from.
  void fill(std::span<const std::span<const Particle>> sources, std::span<const RecordRequest> requests);

  /// What has been learnt so far.
  const IlluminationCache& cache() const { return cache_; }

  float unit() const { return unit_; }
  /// Share of records that have seen fewer than 5 particles a component.
  double undersampledFraction() const;

 private:
  struct Training {
    Vec3 position, normal, tangent;
    float radius;
    float distance;    // mean distance that the light came from
    float irradiance;  // mean over the passes since it was made
    int passes;
    StepwiseEm em;
    BsdfSamplingFraction fraction;
  };

  std::optional<double> updateAll(const ParticleNeighbours& neighbours);
  void makeRecords(const ParticleNeighbours& neighbours, std::span<const RecordRequest> requests);
  std::optional<Training> makeRecord(const ParticleNeighbours& neighbours, const RecordRequest& request) const;
  void shrinkRadius(Training& record) const;
  void rebuildCache();

  TrainingOptions options_;
  float unit_;
  std::vector<Training> records_;
  IlluminationCache cache_;
};

}  // namespace lobe
