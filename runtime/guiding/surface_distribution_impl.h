#pragma once
// The content of a SurfaceDistribution.

#include <optional>

#include "lobe/surface_distribution.h"
#include "runtime/guiding/bsdf_sampling_fraction.h"
#include "runtime/guiding/guided_density.h"
#include "runtime/guiding/illumination_cache.h"
#include "runtime/guiding/reflectance.h"

namespace lobe {

struct SurfaceDistribution::Impl {
  RecordCopy record;
  Vec3 wo;
  Eigen::Matrix3f axes;     // rotation from the shading frame to the frame of the mixtures
  float side = 1;           // 1 if wo.z ≥ 0, else −1
  float representable = 0;  // largest fraction of samples that mixtures may draw
  bool product = false;
  bool described = false;  // undescribedFraction is 0
  Reflectance reflectance;
  std::optional<GuidedDensity> density;

  void collectReflectance(const SurfaceReflectance& given, const BrdfCaches& caches);
  GuidingDecision decide() const;
  /// The training sample of a direction for the record's BSDF sampling fraction, without its weight. Requires
  /// learnsFraction().
  FractionSample fractionSample(const Vec3& wi, float bsdfPdf) const;
};

}  // namespace lobe
