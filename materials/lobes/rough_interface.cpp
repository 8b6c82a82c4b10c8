#include "materials/lobes/rough_interface.h"

namespace lobe {
namespace {

using Vec3d = Eigen::Vector3d;

/// Walter et al. 2007, equation 20.
FacetScattering reflection(const Microfacet& microfacet, const Vec3d& o, const Vec3d& i) {
  const Vec3d half = (o + i).normalized();
  const double density = 0.25 * microfacet.density(half) * microfacet.shadowingOverCosine(o);
  return {density * microfacet.shadowingOverCosine(i), density, o.dot(half), true};
}

/// Walter et al. 2007, equations 16, 17 and 21.
FacetScattering refraction(const Microfacet& microfacet, double eta, const Vec3d& o, const Vec3d& i) {
  const Vec3d sum = o + eta * i;
  if (!(sum.squaredNorm() > 0.0)) return {};
  const Vec3d half = sum.normalized() * (sum.z() < 0.0 ? -1.0 : 1.0);
  const double cosO = o.dot(half);
  const double cosI = i.dot(half);
  if (!(cosO > 0.0 && cosI < 0.0)) return {};
  const double root = cosO + eta * cosI;
  const double common = microfacet.density(half) * microfacet.shadowingOverCosine(o) * cosO * -cosI / (root * root);
  return {common * microfacet.shadowingOverCosine(Vec3d(i.x(), i.y(), -i.z())), common * eta * eta, cosO, false};
}

}  // namespace

FacetScattering scatterAtFacets(const Microfacet& microfacet, double eta, const Vec3& wo, const Vec3& wi) {
  if (!(wo.z() > 0.0f) || wi.z() == 0.0f) return {};
  const Vec3d o = wo.cast<double>().normalized();
  const Vec3d i = wi.cast<double>().normalized();
  return i.z() > 0.0 ? reflection(microfacet, o, i) : refraction(microfacet, eta, o, i);
}

}  // namespace lobe
