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
  RecordCopy record;  // empty: none serves the point, and density is empty
  Vec3 wo;
  Eigen::Matrix3f axes;     // from the shading frame to the frame of the guiding mixtures
  float side = 1;           // 1 where wo is in front, −1 on the back
  float representable = 0;  // fraction of samples that mixtures may draw
  bool product = false;
  bool described = false;  // the reflectance is all that is reflected
  Reflectance reflectance;
  std::optional<GuidedDensity> density;

  void collectReflectance(const SurfaceReflectance& given, const BrdfCaches& caches);
  GuidingDecision decide() const;
  /// What a direction tells of the record's BSDF sampling fraction, but for its weight. Only where learnsFraction().
  FractionSample fractionSample(const Vec3& wi, float bsdfPdf) const;
};

}  // namespace lobe
