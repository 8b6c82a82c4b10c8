#pragma once
// Gaussians as a structure of arrays (SoA): each field of all components is contiguous, so that one load fills a SIMD
// register. Does not use Eigen, because the kernels are compiled for several instruction sets.

#include <cstddef>

namespace lobe {

/// The fields of a component of weight π, mean (x, y) and covariance Σ = (xx, xy, yy). By its Cholesky factor,
///   π N(p) = scale · 2^(along dx² + across (dy − slope dx)²),  dx = p.x − x, dy = p.y − y,
/// where slope = xy/xx, along = −kHalfLog2e/xx, across = −kHalfLog2e/d and scale = π/(2π sqrt|Σ|); d = |Σ|/xx
/// ("conditional") is the variance of y for given x. The first six fields suffice for the density.
enum class GaussianField { x, y, slope, along, across, scale, xx, xy, conditional, weight, yy };
inline constexpr int kGaussianFields = 11;

/// The stride of a view is a multiple of this.
inline constexpr int kPaddingMultiple = 4;
/// Largest number of components that kernels read or write at once.
inline constexpr int kMaxVectorLanes = 8;

/// Largest numbers of components of the two factors of a product. Larger ones are refused when a cache or record is
/// created.
inline constexpr int kMaxReflectanceComponents = 32;
inline constexpr int kMaxLightComponents = 8;

inline constexpr float kHalfLog2e = 0.72134752f;

/// A read-only view. Field f of component k is data[f·stride + k]; stride is a multiple of kPaddingMultiple.
struct GaussiansView {
  const float* data;
  int stride;
  int count;

  const float* field(GaussianField f) const { return data + static_cast<std::ptrdiff_t>(f) * stride; }
};

}  // namespace lobe
