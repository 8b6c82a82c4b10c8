#pragma once
// From the direction that a mixture was fitted for to the one asked for: the look-up that renderer and fitter share.

#include <span>

#include "runtime/mixture/gaussian.h"
#include "runtime/mixture/grid.h"
#include "runtime/mixture/kernels.h"

namespace lobe {

/// Of a lobe that is symmetric in both tangent axes, the directions with x, y ≥ 0 are enough.
struct Mirror {
  bool x = false, y = false;
  static Mirror intoQuadrant(const Vec3& w) { return {w.x() < 0, w.y() < 0}; }
  Vec3 operator()(const Vec3& w) const { return {x ? -w.x() : w.x(), y ? -w.y() : w.y(), w.z()}; }
};

/// How a fitted mixture is to be brought elsewhere.
struct Alignment {
  GridKind kind;
  Vec2 reference;  ///< the direction it was fitted for, on the disc
  Mirror mirror;   ///< applied to mixture and reference first
};

/// Brings the mixture to wo (unit, z ≥ 0). What was fitted for an elevation is turned to wo's azimuth first. Then all
/// means move by −(y(wo) − y(reference)), because the centre of a reflection lobe is near −y(wo); the step of a mean
/// that lies in the disc and would leave it ends at the edge. Writes to the front of out, which has room for all
/// components, and returns what was written. No allocation. (Herholz et al. 2016, Section 4; the sign is tested by
/// NEV.)
std::span<Gaussian> alignMixture(const Alignment& alignment, std::span<const Gaussian> components, const Vec3& wo,
                                 std::span<Gaussian> out);

/// The same for placeMixture, with a factor of 1.
Placement placementOf(const Alignment& alignment, const Vec3& wo);

}  // namespace lobe
