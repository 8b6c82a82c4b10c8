#pragma once
// The screened Poisson equation: an image from its noisy pixels and the less noisy differences of neighbouring pixels
// (Lehtinen et al. 2013, "Gradient-Domain Metropolis Light Transport"; Kettunen et al. 2015, Section 4).

#include "runtime/image/image.h"

namespace lobe {

/// l2: least squares, which is linear in its input, so that the expected image is unbiased. l1: least absolute
/// deviations, which ignores outliers, but is biased.
enum class ReconstructionNorm { l2, l1 };

/// The weight of the pixels relative to the differences (Kettunen et al. 2015).
inline constexpr double kScreening = 0.2;

/// Minimises ‖∂x I − dx‖ + ‖∂y I − dy‖ + ‖kScreening (I − pixels)‖, for L2 with squared norms. dx at (x, y) is the
/// difference of the pixels (x + 1, y) and (x, y), dy that of (x, y + 1) and (x, y); the last column of dx and the last
/// row of dy are ignored. All images have the same size and are finite. For L1, the norm of a colour is Euclidean. The
/// result may be negative.
Image reconstruct(const Image& pixels, const Image& dx, const Image& dy, ReconstructionNorm norm);

}  // namespace lobe
