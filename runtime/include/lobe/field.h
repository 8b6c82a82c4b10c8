#pragma once
// The trained illumination of a scene: a spatial cache of records, each of which represents the distribution of
// incident radiance times cosine, L cosθ, at a surface point by a Gaussian mixture over the unit disc (the equal-area
// image of the hemisphere). Records are learnt from particles in passes (Vorba et al. 2014, "On-line Learning of
// Parametric Mixture Models for Light Transport Simulation", Section 5; Herholz et al. 2016, "Product Importance
// Sampling for Light Transport Path Guiding").

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>

#include "lobe/sample_storage.h"

namespace lobe {

/// Options of training.
struct FieldOptions {
  static constexpr int kMostComponents = 8;

  float sceneDiagonal = 1;  ///< diagonal of a box around what the camera sees in world units, > 0
  int components = 8;       ///< Gaussians per record, 1 to kMostComponents
  int neighbours = 250;     ///< largest number of photons, and of camera-path samples, per record and pass, ≥ 1
  /// Largest number of particles of all passes that each record keeps for refit, at 16 bytes each, ≥ 0.
  int reservoir = 500;
  float unitFraction = 0.02f;  ///< largest radius of a record, as a fraction of sceneDiagonal, in (0, 1]
  /// Largest parallax within the radius of a record, in standard deviations of a component, > 0. Smaller values give
  /// smaller radii and more records.
  float maxParallax = 5.0f;

  /// Throws std::runtime_error that names the first field that is out of range.
  void validate() const;
};

class Field;
class IlluminationCache;
struct FieldData;

// For internal use by the library and its tools; see runtime/guiding/field_data.h.
const IlluminationCache& cacheOf(const Field& field);
Field fieldOf(IlluminationCache cache);

/// The trained illumination. Copies are cheap and share their content: an update of one changes all of them, while
/// frozen() and reduced() make independent fields.
///
/// Threads: update, refit and fill must not run while another thread uses the field or a copy of it. All other
/// functions are const and may be called from any thread.
///
/// Parallel loops: the functions that create or change records use oneTBB, in the task arena of the calling thread,
/// whose number of threads the host may limit. They may be called in a task; a thread that waits for them runs no other
/// tasks of the host meanwhile. If the task group of that task is cancelled, they throw std::runtime_error. After any
/// exception, std::bad_alloc included, the records may have been updated in part.
class Field {
 public:
  /// A field without records that cannot be trained.
  Field();
  /// A field ready for training, without records or, with the field of an earlier training of the same scene, with its
  /// records: these stay as they are, and training adds records where none of them serves. Throws std::runtime_error
  /// for options out of range.
  explicit Field(const FieldOptions& options, const Field& earlier = Field());
  ~Field();
  Field(const Field&);
  Field& operator=(const Field&);

  /// Reads a file that save wrote. The field can be used for rendering, or as the `earlier` one of a new field, but not
  /// trained further. Throws std::runtime_error that names the file if it is missing, damaged or of another major
  /// format version.
  static Field load(const std::filesystem::path& path);
  /// Writes the records to a file. Equal fields give equal bytes. The file is replaced atomically: if writing fails, an
  /// existing file stays unchanged, and std::runtime_error that names the file is thrown.
  void save(const std::filesystem::path& path) const;

  /// Performs one training pass: learns the BSDF sampling fractions, updates every record from the particles near it,
  /// and creates the requested records where there are particles. The result depends on the indices of the paths
  /// (SampleStorage::beginPath), not on threads. Samples of the BSDF sampling fraction must have been recorded with
  /// this field or a copy of it.
  ///
  /// Returns the log-likelihood of the particles near a record under its mixture before the update, in nats, of the
  /// density over the area of the disc, averaged over the records: a measure on data that was not trained on. nullopt
  /// if no record had particles near it. Throws std::logic_error if the field cannot be trained (it was
  /// default-constructed, loaded, frozen or reduced).
  std::optional<double> update(const SampleStorage& storage);

  /// Fits every record once more to a sample of the particles of all passes that were near it, which corrects what the
  /// updates have forgotten. Intended for the end of training, before the last fill. Does nothing if
  /// FieldOptions::reservoir is 0. Throws std::logic_error as update does.
  void refit();

  /// Creates the records that `requests` asks for, from the particles of `particles`; existing records are not changed.
  /// Intended for the end of training, because the radii of records shrink in updates and leave gaps. Throws
  /// std::logic_error as update does.
  void fill(const SampleStorage& requests, const SampleStorage& particles);

  /// An independent copy of the records for rendering, without the training data.
  Field frozen() const;

  /// As frozen, but the Gaussians of each record are merged until the sum of the merge costs would exceed `cost` ≥ 0
  /// (Runnalls' cost, Herholz et al. 2016, Appendix B). A record of up to four components takes about half the memory.
  Field reduced(float cost) const;

  std::size_t records() const;  ///< number of records
  /// Memory of the records and their look-up structure. A field that can be trained takes several times as much, mainly
  /// for FieldOptions::reservoir; frozen() leaves that out.
  std::size_t bytes() const;
  double meanComponents() const;  ///< mean number of Gaussians per record; 0 if there are no records
  /// Fraction of the records that were trained with fewer than 5 particles per Gaussian; 0 if the field cannot be
  /// trained.
  double undersampledFraction() const;

 private:
  friend class SurfaceDistribution;
  friend const IlluminationCache& cacheOf(const Field& field);
  friend Field fieldOf(IlluminationCache cache);
  explicit Field(std::shared_ptr<FieldData> data);
  const IlluminationCache& cache() const;
  std::shared_ptr<FieldData> data_;
};

}  // namespace lobe
