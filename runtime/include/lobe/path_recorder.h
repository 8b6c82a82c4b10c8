#pragma once
// Records camera paths of the host renderer, vertex by vertex, as training samples for a Field.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "lobe/sample_storage.h"
#include "lobe/surface_distribution.h"

namespace lobe {

/// A vertex from which a path continues in a sampled direction. Colours are linear RGB with Rec. 709 primaries.
struct RecordedVertex {
  Float3 position, normal;  ///< world space; normal: unit geometric normal, facing either side
  Float3 direction;         ///< the sampled direction: unit, world space, away from the surface
  Float3 wi;                ///< the same direction in the shading frame of the ShadingPoint
  float pdf;                ///< density over solid angle with which the direction was sampled, > 0
  /// Density over solid angle of the BSDF's own sampler, > 0. Only needed for the BSDF sampling fraction, if
  /// learnsFraction(); without it, the vertex is no sample for that.
  float bsdfPdf = 0;
  Float3 weight;      ///< BSDF value times |cosθ| / pdf
  Float3 throughput;  ///< path throughput, including `weight`, before Russian roulette at this vertex
};

struct PathRecorderOptions {
  bool particles = true;  ///< record samples of incident radiance, from which illumination records are learnt
  bool fractions = true;  ///< record samples for the BSDF sampling fraction
};

/// Converts camera paths, one at a time, into samples of incident radiance: the radiance arriving at a vertex from the
/// sampled direction is estimated by the light that the rest of the path collects. Not thread-safe: use one recorder
/// and one storage per thread.
class PathRecorder {
 public:
  /// Writes to `storage`, which must outlive the recorder.
  explicit PathRecorder(SampleStorage& storage, const PathRecorderOptions& options = {})
      : storage_(&storage), options_(options) {}

  /// Begins a path and calls SampleStorage::beginPath(pathIndex) of the storage.
  void begin(std::uint64_t pathIndex);

  /// Adds a vertex. `distribution` is the distribution that the direction was drawn from, or nullptr if the BSDF's
  /// sampler was used without one; it is not kept. Vertices beyond kMaxVertices are ignored. Do not add vertices with
  /// delta scattering.
  void addVertex(const RecordedVertex& vertex, const SurfaceDistribution* distribution);

  /// Sets the distance, in world units, from the last vertex to the next surface in the sampled direction, > 0;
  /// +infinity (the default) if the ray hits nothing, as which other values count. Only the first call after addVertex
  /// has an effect, so that it can be called for every ray of the path, also for those that delta scattering continues
  /// without a vertex.
  void setDistance(float distance);

  /// Adds light that the path collects, as a contribution to the pixel: radiance times throughput and the weight of
  /// multiple importance sampling. It counts as incident radiance at all vertices added so far. Light collected by
  /// next-event estimation at a surface must therefore be added before addVertex of that surface.
  void addLight(const Float3& contribution);

  /// Ends the path and writes its samples to the storage. Samples that are not positive and finite are omitted.
  void end();

  static constexpr int kMaxVertices = 32;

 private:
  struct Fraction {
    std::size_t record;
    float bsdfPdf, mixturePdf, representable, weight;
  };
  struct Vertex {
    Float3 position, normal, direction;
    float cosineOverPdf, distance;
    Float3 throughput;
    float radiance;  // incident radiance (luminance) from the direction, summed over addLight
    std::optional<Fraction> fraction;
  };
  SampleStorage* storage_;
  PathRecorderOptions options_;
  std::array<Vertex, kMaxVertices> vertices_;
  int count_ = 0;
  bool awaitsDistance_ = false;  // the last vertex has no distance yet
};

}  // namespace lobe
