#pragma once
// Trained illumination: records of incident radiance times cosine, as Gaussian mixtures on the hemisphere's disc (Vorba
// et al. 2014, Section 5; Herholz et al. 2016), learnt from particles in passes.

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>

#include "lobe/sample_storage.h"

namespace lobe {

struct FieldOptions {
  static constexpr int kMostComponents = 8;

  float sceneDiagonal = 1;     ///< of the scene's bounding box, world units, > 0
  int components = 8;          ///< Gaussians of a record, 1 to kMostComponents
  int neighbours = 250;        ///< particles that a record is updated from in a pass, at most
  float unitFraction = 0.02f;  ///< largest radius of a record, as a fraction of the diagonal, in (0, 1]
  float klThreshold =
      5.0f;  ///< standard deviations by which parallax may move a component within a record's radius, > 0

  /// Throws std::runtime_error that names the field.
  void validate() const;
};

class Field;
class IlluminationCache;
struct FieldData;

// For the parts of the library and the tools that look inside; see runtime/guiding/field_data.h.
const IlluminationCache& cacheOf(const Field& field);
Field fieldOf(IlluminationCache cache);

/// Copies share what has been learnt. update and fill must not run while other threads use the field; everything else
/// is const and may be called from any thread.
class Field {
 public:
  /// Without records, and not to be trained.
  Field();
  /// Nothing learnt yet. Throws std::runtime_error for options out of range.
  explicit Field(const FieldOptions& options);
  ~Field();
  Field(const Field&);
  Field& operator=(const Field&);

  /// What save wrote: for rendering, not for further training. Throws std::runtime_error that names the file when it is
  /// missing, damaged or of a newer version.
  static Field load(const std::filesystem::path& path);
  /// Throws std::runtime_error that names the file. The file appears whole or not at all; the same field gives the same
  /// bytes.
  void save(const std::filesystem::path& path) const;

  /// One training pass: updates every record from the particles around it, makes records where they were requested and
  /// particles are, and learns the BSDF sampling fractions. Depends on the order of the paths in the storage, not on
  /// threads. Returns the mean over the records of the log-likelihood of the pass's particles before they were learnt
  /// from (nats); nullopt: no record has met a particle. Throws std::logic_error for a field that was loaded.
  std::optional<double> update(const SampleStorage& storage);

  /// Makes the records that one storage requests, from the particles of another; updates none. For the end of training,
  /// when radii have shrunk since the last requests. Throws as update.
  void fill(const SampleStorage& requests, const SampleStorage& particles);

  /// The same without what training needs, for rendering.
  Field frozen() const;

  /// As frozen, with mixtures merged up to this cost (Runnalls; Herholz et al. 2016, Appendix
  /// B), ≥ 0. Records of four components or fewer take half the memory.
  Field reduced(float cost) const;

  std::size_t records() const;
  std::size_t bytes() const;
  double meanComponents() const;        ///< of a record; 0 without records
  double undersampledFraction() const;  ///< of the records: those that have seen fewer than five particles a component

 private:
  friend class SurfaceDistribution;
  friend const IlluminationCache& cacheOf(const Field& field);
  friend Field fieldOf(IlluminationCache cache);
  explicit Field(std::shared_ptr<FieldData> data);
  const IlluminationCache& cache() const;
  std::shared_ptr<FieldData> data_;
};

}  // namespace lobe
