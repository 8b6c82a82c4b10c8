#pragma once
// What a host's camera paths tell a field: told vertex by vertex while a path is traced.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "lobe/sample_storage.h"
#include "lobe/surface_distribution.h"

namespace lobe {

/// What is recorded where a path goes on from a surface. Colours are linear RGB with Rec. 709 primaries.
struct RecordedVertex {
  Float3 position, normal;  ///< world space; unit geometric normal, of either side
  Float3 direction;         ///< unit, world space: the direction sampled
  Float3 wi;                ///< the same, local as the distribution knows it
  float pdf;                ///< > 0, the density that it was drawn with, over solid angle
  float bsdfPdf = 0;        ///< the BSDF's own density of it; needed where the distribution says learnsFraction()
  Float3 weight;            ///< f |cosθ| / pdf
  Float3 throughput;        ///< of the path behind this vertex, weight included, before Russian roulette
};

struct PathRecorderOptions {
  bool particles = true;  ///< record what illumination records learn from
  bool fractions = true;  ///< record what BSDF sampling fractions are learnt from
};

/// Turns one path at a time into samples of incident light: what arrived at each vertex from the direction sampled
/// there is the light that the path collects behind it. One a thread.
class PathRecorder {
 public:
  /// The storage outlives it.
  explicit PathRecorder(SampleStorage& storage, const PathRecorderOptions& options = {})
      : storage_(&storage), options_(options) {}

  /// Begins a path; what the storage is told from here on belongs to it.
  void begin(std::uint64_t pathIndex);

  /// The path goes on from a surface. distribution: that the direction was drawn from, or nullptr. Vertices beyond
  /// kMaxVertices are not recorded. Delta scattering is not to be recorded.
  void addVertex(const RecordedVertex& vertex, const SurfaceDistribution* distribution);

  /// The distance to where the last vertex's direction led; +infinity (the default) when nothing is hit.
  void setDistance(float distance);

  /// Light that the path found, as it contributes to the pixel: throughput and multiple importance weights included.
  void addLight(const Float3& contribution);

  /// Ends the path: its samples go to the storage.
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
    float radiance;  // that arrived from the direction, luminance
    std::optional<Fraction> fraction;
  };
  SampleStorage* storage_;
  PathRecorderOptions options_;
  std::array<Vertex, kMaxVertices> vertices_;
  int count_ = 0;
};

}  // namespace lobe
