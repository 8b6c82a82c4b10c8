#pragma once
// The inner loops of product sampling, for the best instruction set that the machine has (SSE4, AVX2 or AVX-512, found
// when the program runs). Nothing allocates. Results of different instruction sets differ by rounding.
//
// A reflectance is a view whose lanes behind `count` may be read, up to a multiple of kMaxVectorLanes, and hold
// anything. A light is a view of stride 4 or 8 whose lanes behind `count` are dead (see packGaussians).

#include <cstdint>
#include <string>
#include <vector>

#include "runtime/mixture/soa_gaussians.h"

namespace lobe {

/// With G1 = constant + Σ a_i N_i and G2 = Σ b_j N_j: the masses of all pairs, a_i b_j N(μ_i − μ_j | 0, Σ_i + Σ_j) at
/// pairs[i·stride + j] for the light's stride, and constant · b_j in the row behind the last component; the sums over i
/// and over all columns up to j at columns[j]. Returns the last of these, Z = ∫ G1 G2.
///
/// The sum of two covariances is made of their Cholesky factors: |S| = (d_i + d_j) S_xx + xx_i xx_j (slope_i −
/// slope_j)² is a sum of positive terms, exact also for long thin lobes whose determinants cancel.
float pairMasses(const GaussiansView& reflectance, float constant, const GaussiansView& light, float* pairs,
                 float* columns);

struct PairIndex {
  int row, column;
};
/// A pair in proportion to its mass, with `choice` uniform in [0,1); of what pairMasses wrote, with a positive and
/// finite sum. rows: of pairs, the constant's included.
PairIndex choosePair(const float* pairs, const float* columns, int rows, int stride, float choice);

/// Σ π_k N_k at (x, y), of a light; 0 far away.
float lightDensity(const GaussiansView& light, float x, float y);

struct Densities {
  float reflectance, light;
};
/// Both mixtures at (x, y).
Densities densities(const GaussiansView& reflectance, const GaussiansView& light, float x, float y);

/// How a mixture is brought elsewhere: mirrored by signs ±1, moved by a step (shortened so that no mean that lies in
/// the disc leaves it), turned about the disc's centre by the angle of (cosine, sine), its weights multiplied by
/// `factor`.
struct Placement {
  float mirrorX = 1, mirrorY = 1;
  float stepX = 0, stepY = 0;
  float cosine = 1, sine = 0;
  float factor = 1;
};

/// Writes the mixture so placed to lanes first, first + 1, ... of `out`, which has room for that and for
/// kMaxVectorLanes behind. The mixture's lanes may be read up to a multiple of kMaxVectorLanes.
void placeMixture(const GaussiansView& mixture, const Placement& placement, float* out, int stride, int first);

/// The instruction sets that there are kernels for and that this machine has, as Highway numbers them.
std::vector<std::int64_t> kernelTargets();
/// Of one of them.
std::string kernelTargetName(std::int64_t target);
/// For tests and benchmarks, not while kernels run: all kernels use this one from now on; 0: the best again.
void useKernelTarget(std::int64_t target);

}  // namespace lobe
