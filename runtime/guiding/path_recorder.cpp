#include "lobe/path_recorder.h"

#include <cmath>
#include <limits>

#include "runtime/core/vec.h"
#include "runtime/guiding/conversions.h"
#include "runtime/guiding/sample_storage_data.h"
#include "runtime/guiding/surface_distribution_impl.h"

namespace lobe {
namespace {

bool usable(float x) {
  return x > 0 && std::isfinite(x);
}

}  // namespace

void PathRecorder::begin(std::uint64_t pathIndex) {
  storage_->beginPath(pathIndex);
  count_ = 0;
  awaitsDistance_ = false;
}

void PathRecorder::addVertex(const RecordedVertex& recorded, const SurfaceDistribution* distribution) {
  awaitsDistance_ = count_ < kMaxVertices;
  if (!awaitsDistance_) return;
  const Vec3 direction = toEigen(recorded.direction);
  const Vec3 front = toEigen(recorded.normal);
  const Vec3 normal = std::copysign(1.0f, front.dot(direction)) * front;
  Vertex& last = vertices_[static_cast<std::size_t>(count_++)];
  last = {recorded.position,
          toFloats(normal),
          recorded.direction,
          normal.dot(direction) / recorded.pdf,
          std::numeric_limits<float>::infinity(),
          recorded.throughput,
          0,
          std::nullopt};
  if (!options_.fractions || !distribution || !distribution->learnsFraction()) return;
  const FractionSample fraction = distribution->impl().fractionSample(toEigen(recorded.wi), recorded.bsdfPdf);
  const Rgb weight = toEigen(recorded.weight).array();
  last.fraction = {fraction.record, fraction.bsdf, fraction.mixtures, fraction.representable, luminance(weight)};
}

void PathRecorder::setDistance(float distance) {
  if (awaitsDistance_) vertices_[static_cast<std::size_t>(count_ - 1)].distance = distance;
  awaitsDistance_ = false;
}

// Light that reaches the camera passes through every earlier vertex, where it is incident radiance from the next
// vertex.
void PathRecorder::addLight(const Float3& contribution) {
  const Rgb light = toEigen(contribution).array();
  for (int i = 0; i < count_; ++i) {
    Vertex& vertex = vertices_[static_cast<std::size_t>(i)];
    const Rgb carried = toEigen(vertex.throughput).array();
    vertex.radiance += luminance((carried > 0).select(light / carried, Rgb::Zero()));
  }
}

void PathRecorder::end() {
  SampleStorageData& data = *storage_->data_;
  for (int i = 0; i < count_; ++i) {
    const Vertex& v = vertices_[static_cast<std::size_t>(i)];
    const float weight = v.cosineOverPdf * v.radiance;
    const bool finite = isFinite(v.position) && isFinite(v.normal) && isFinite(v.direction);
    if (options_.particles && usable(weight) && finite)
      data.samples.push_back({toEigen(v.position), toEigen(v.normal), toEigen(v.direction), weight, v.distance});
    if (!v.fraction) continue;
    const float fractionWeight = v.fraction->weight * v.radiance;
    if (usable(fractionWeight) && usable(v.fraction->bsdfPdf))
      data.fractions.push_back(
          {v.fraction->record, v.fraction->bsdfPdf, v.fraction->mixturePdf, v.fraction->representable, fractionWeight});
  }
  count_ = 0;
  awaitsDistance_ = false;
}

}  // namespace lobe
