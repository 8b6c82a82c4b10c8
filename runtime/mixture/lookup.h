#pragma once
// Moves a mixture from the direction wo that it was fitted for to another one; used by both renderer and fitter.

#include <span>

#include "runtime/mixture/gaussian.h"
#include "runtime/mixture/grid.h"
#include "runtime/mixture/kernels.h"

namespace lobe {

/// A reflection in the tangent axes. Mixtures of a lobe that is symmetric in both axes are needed only for directions
/// with x, y ≥ 0.
struct Mirror {
  bool x = false, y = false;
  static Mirror intoQuadrant(const Vec3& w) { return {w.x() < 0, w.y() < 0}; }
  Vec3 operator()(const Vec3& w) const { return {x ? -w.x() : w.x(), y ? -w.y() : w.y(), w.z()}; }
};

/// Describes where a mixture was fitted.
struct Alignment {
  GridKind kind;
  Vec2 reference;  ///< the direction that it was fitted for, on the disc
  Mirror mirror;   ///< applied first, to mixture and reference
};

/// Moves the mixture to wo (unit, z ≥ 0). Mixtures of an elevation grid are rotated to wo's azimuth first. Then all
/// means are translated by −(y(wo) − y(reference)), because the centre of a reflection lobe is near −y(wo); a mean that
/// would leave the disc stops at the edge (Herholz et al. 2016, Section 4; the sign was verified by the relative
/// variance). Writes to the front of out, which must have room for all components, and returns the part written. Does
/// not allocate.
std::span<Gaussian> alignMixture(const Alignment& alignment, std::span<const Gaussian> components, const Vec3& wo,
                                 std::span<Gaussian> out);

/// The same transformation as an argument of placeMixture, with a factor of 1.
Placement placementOf(const Alignment& alignment, const Vec3& wo);

}  // namespace lobe
