#pragma once
// Gaussians side by side: a field of all components is one run of floats, so that one load feeds one set of lanes. No
// Eigen in here: the kernels are compiled for several instruction sets.

#include <cstddef>

namespace lobe {

/// What is kept of a component of weight π, mean (x, y) and covariance Σ = (xx, xy, yy). With its Cholesky factor,
///   π N(p) = scale · 2^(along dx² + across (dy − slope dx)²),  dx = p.x − x, dy = p.y − y,
/// where slope = xy/xx and, with conditional d = |Σ|/xx, the variance of y at a given x, along = −kHalfLog2e/xx, across
/// = −kHalfLog2e/d, scale = π/(2π sqrt|Σ|). All but xx, xy, yy and weight are what the density needs.
enum class GaussianField { x, y, slope, along, across, scale, xx, xy, conditional, weight, yy };
inline constexpr int kGaussianFields = 11;

/// Lanes come in multiples of this many.
inline constexpr int kPaddingMultiple = 4;
/// Kernels may read and write this many lanes at once.
inline constexpr int kMaxVectorLanes = 8;

/// Largest component counts of the two factors of a product; more is refused when a cache or record is made.
inline constexpr int kMaxReflectanceComponents = 32;
inline constexpr int kMaxLightComponents = 8;

inline constexpr float kHalfLog2e = 0.72134752f;

/// Components to read. Field f of component k is at data[f·stride + k]; stride is a multiple of kPaddingMultiple.
struct GaussiansView {
  const float* data;
  int stride;
  int count;

  const float* field(GaussianField f) const { return data + static_cast<std::ptrdiff_t>(f) * stride; }
};

}  // namespace lobe
