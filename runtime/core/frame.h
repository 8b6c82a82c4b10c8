#pragma once
// An orthonormal shading frame: the local z axis is the normal, x the tangent (direction of alphaU), y the bitangent.

#include <cmath>

#include <Eigen/Geometry>

#include "runtime/core/vec.h"

namespace lobe {

struct Frame {
  Vec3 s = Vec3::UnitX();
  Vec3 t = Vec3::UnitY();
  Vec3 n = Vec3::UnitZ();

  Frame() = default;
  Frame(const Vec3& tangent, const Vec3& bitangent, const Vec3& normal) : s(tangent), t(bitangent), n(normal) {}

  /// A frame whose z axis is the unit vector n, continuous except where n.z changes sign (Duff et al. 2017, JCGT 6(1)).
  static Frame fromNormal(const Vec3& n) {
    const float sign = std::copysign(1.0f, n.z());
    const float a = -1.0f / (sign + n.z());
    const float b = n.x() * n.y() * a;
    return {Vec3(1.0f + sign * n.x() * n.x() * a, sign * b, -sign * n.x()), Vec3(b, sign + n.y() * n.y() * a, -n.y()),
            n};
  }

  /// A frame whose z axis is the unit normal n and whose x axis is dpdu made orthogonal to n; fromNormal(n) if dpdu is
  /// zero or nearly parallel to n.
  static Frame fromTangent(const Vec3& n, const Vec3& dpdu) {
    const Vec3 s = dpdu - n * n.dot(dpdu);
    const float length = s.norm();
    if (!(length > 1e-6f * dpdu.norm())) return fromNormal(n);
    const Vec3 tangent = s / length;
    return {tangent, n.cross(tangent), n};
  }

  Vec3 toLocal(const Vec3& v) const { return {v.dot(s), v.dot(t), v.dot(n)}; }
  Vec3 toWorld(const Vec3& v) const { return s * v.x() + t * v.y() + n * v.z(); }
};

}  // namespace lobe
