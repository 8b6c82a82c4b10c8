#pragma once
// The inner loops of product sampling, compiled for several instruction sets (SSE4, AVX2, AVX-512) of which the best is
// chosen at run time. No function allocates memory. Results of different instruction sets differ by rounding.
//
// Requirements on arguments: behind the `count` Gaussians of a reflectance there must be readable padding lanes, with
// any content, up to a multiple of kMaxVectorLanes. A light must have stride 4 or 8 and zero-weight padding from
// `count` to the stride (see packGaussians).

#include <cstdint>
#include <string>
#include <vector>

#include "runtime/mixture/soa_gaussians.h"

namespace lobe {

/// For G1 = constant + Σ a_i N_i (reflectance) and G2 = Σ b_j N_j (light), computes the masses of all pairs: a_i b_j
/// N(μ_i − μ_j | 0, Σ_i + Σ_j) at pairs[i·stride + j], with the light's stride, and constant · b_j in the row after the
/// last component. columns[j] receives the running sum of the column sums up to j. Returns the last of them, Z = ∫
/// G1·G2.
///
/// The determinant of S = Σ_i + Σ_j is computed from the Cholesky factors as |S| = (d_i + d_j) S_xx + xx_i xx_j
/// (slope_i − slope_j)², a sum of positive terms that is accurate for elongated Gaussians as well.
float pairMasses(const GaussiansView& reflectance, float constant, const GaussiansView& light, float* pairs,
                 float* columns);

struct PairIndex {
  int row, column;
};
/// Chooses a pair in proportion to its mass with `choice` uniform in [0,1). pairs, columns: as written by pairMasses,
/// with a positive and finite sum. rows: number of rows, including that of the constant.
PairIndex choosePair(const float* pairs, const float* columns, int rows, int stride, float choice);

/// Σ π_k N_k(x, y) of a light, over the plane's area.
float lightDensity(const GaussiansView& light, float x, float y);

struct Densities {
  float reflectance, light;
};
/// The values of both mixtures at (x, y), as lightDensity.
Densities densities(const GaussiansView& reflectance, const GaussiansView& light, float x, float y);

/// A transformation of a mixture, applied in this order: reflection by signs ±1; translation by a step, which is
/// shortened for means that would leave the disc; rotation about the disc's centre by the angle of (cosine, sine);
/// multiplication of the weights by `factor`.
struct Placement {
  float mirrorX = 1, mirrorY = 1;
  float stepX = 0, stepY = 0;
  float cosine = 1, sine = 0;
  float factor = 1;
};

/// Writes the transformed mixture to the Gaussians first, first + 1, ... of `out`, which must have room for them and
/// for kMaxVectorLanes more. The mixture must be readable up to a multiple of kMaxVectorLanes.
void placeMixture(const GaussiansView& mixture, const Placement& placement, float* out, int stride, int first);

/// The instruction sets that kernels were compiled for and that this machine supports, as Highway's target numbers.
std::vector<std::int64_t> kernelTargets();
/// The name of one of them.
std::string kernelTargetName(std::int64_t target);
/// Selects the instruction set of all kernels; 0 selects the best. For tests and benchmarks; not while kernels run.
void useKernelTarget(std::int64_t target);

}  // namespace lobe
