#pragma once
// Multiple importance sampling of bidirectional path tracing: sums over the techniques that make the same path with
// fewer vertices on one subpath, kept up to date along that subpath (Georgiev 2012, "Implementing Vertex Connection and
// Merging", Section 4: the quantities dVCM and dVC). If vertices of both subpaths are also merged, the report's dVM is
// dVC divided by a constant, so that it needs no sum of its own.
//
// The power heuristic with exponent 2 is used. Densities over area follow from those over solid angle with the cosine
// to the geometric normal. A delta component has density 1 in both directions, and the probability of choosing it and
// Russian roulette are left out: any function of the path alone is a valid density for the weights, as long as all
// techniques use the same.

namespace lobe {

inline double squared(double x) {
  return x * x;
}

class PartialWeights {
 public:
  /// A subpath that starts at a light. connection: the density with which next-event estimation from the first vertex
  /// finds the origin (LightSelection::pdf); emission: that of the emitted ray (Lights::photonDensity); cosine: at the
  /// origin, 1 for a light without surface; delta: whether no path from the camera hits the light. merging: the number
  /// of light paths times the area around a vertex within which it is merged with theirs; 0: vertices are not merged.
  static PartialWeights fromLight(float connection, float emission, float cosine, bool delta, double merging) {
    return {squared(static_cast<double>(connection) * cosine / emission),
            delta ? 0.0 : squared(static_cast<double>(cosine) / emission), squared(merging)};
  }
  /// A subpath that starts at the camera. density: over perpendicular area at the first vertex, for one ray per pixel
  /// (RayCamera::density); lightPaths: the number of light paths that may be connected to the camera, per ray.
  static PartialWeights fromCamera(float density, double lightPaths, double merging) {
    return {squared(lightPaths / density), 0.0, squared(merging)};
  }

  /// No technique at all.
  static PartialWeights none() { return {0.0, 0.0, 0.0}; }

  /// A vertex at the end of a segment. cosine: of the segment, at that vertex. distance: of the segment; 1 for the
  /// first segment of a subpath, because the functions above account for it.
  void arrive(float distance, float cosine) {
    vcm_ *= squared(squared(distance) / cosine);
    vc_ /= squared(cosine);
  }
  /// The vertex scatters in a direction with a cosine. pdf: density of the direction; reverse: density with which paths
  /// from the other end sample the direction back along the segment; both over solid angle.
  void scatter(float pdf, float reverse, float cosine) {
    vc_ = squared(static_cast<double>(cosine) / pdf) * sumOfOthers(reverse);
    vcm_ = 1.0 / squared(pdf);
  }
  /// The vertex scatters by a delta component. arriving: cosine of the segment at the vertex; eta: index of refraction
  /// behind the vertex over that before it. The ratio of the densities of both directions is the ratio of the solid
  /// angles, so that vc is only scaled by 1/eta² (n² dA cosθ dω is conserved).
  void scatterDelta(float arriving, float eta) {
    vc_ *= squared(static_cast<double>(arriving) / squared(eta));
    vcm_ = 0.0;
  }
  /// A delta component of a light subpath that next-event estimation passes, too, before the first `scatter`.
  void pass(float arriving, float eta) {
    const double scale = squared(static_cast<double>(arriving) / squared(eta));
    vc_ *= scale;
    vcm_ *= scale;
  }
  /// At the vertex of a light subpath up to which next-event estimation would follow the light: multiplies the density
  /// `connection` of fromLight.
  void connect(float density) { vcm_ *= squared(density); }
  /// Excludes the connection of the last vertex to a vertex of the other subpath.
  void disconnect() { vcm_ = 0.0; }
  /// Excludes all techniques that would make the subpath up to here from its other end.
  void exclude() { vc_ = 0.0; }

  /// Sum of the squared densities of the techniques in which the other subpath contains this vertex, divided by the
  /// squared density with which that subpath samples it. reverse: as in scatter, at this vertex.
  double sumOfOthers(float reverse) const { return merging_ + vcm_ + vc_ * squared(reverse); }

  /// Whether sumOfOthers depends on its argument.
  bool dependsOnReverse() const { return vc_ > 0.0; }

  /// The weight of merging this vertex of a camera path with one of a light path; reverse, lightReverse: as in
  /// sumOfOthers for either. Must not be called if vertices are not merged.
  double ofMerging(float reverse, const PartialWeights& light, float lightReverse) const {
    const double others = vcm_ + vc_ * squared(reverse) + light.vcm_ + light.vc_ * squared(lightReverse);
    return merging_ / (merging_ + others);
  }

  /// For a camera subpath that has found emission, before arrive is called. connection and emission: as in fromLight;
  /// cosine: at the light.
  double atLight(float connection, float emission, float cosine) const {
    return vcm_ * squared(connection) + vc_ * squared(static_cast<double>(emission) / cosine);
  }

 private:
  PartialWeights(double vcm, double vc, double merging) : vcm_(vcm), vc_(vc), merging_(merging) {}
  double vcm_, vc_;
  double merging_;  // squared
};

}  // namespace lobe
