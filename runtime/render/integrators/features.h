#pragma once
// What the camera sees in each pixel, for denoisers and compositing: albedo, normal and depth. They depend on the
// scene, the camera and the random numbers of the samples alone, not on the integrator, and are computed from camera
// rays of their own, one for each sample, which pass the film at a point that is sampled from the filter of the pixel.
// So a resumed run, and parts of a picture, have the same features.

#include "runtime/render/integrators/renderer.h"
#include "runtime/render/lights/render_scene.h"

namespace lobe {

/// Of one camera ray.
struct Features {
  /// Reflectance in [0,1] of the first surface that is not purely specular. Where the ray meets purely specular
  /// surfaces before, the mean over the reflected and refracted rays, weighted by the probabilities of the components.
  /// Black where a ray leaves the scene.
  Rgb albedo = Rgb::Zero();
  /// Unit shading normal of the same surface in world space, on the side from which the ray comes; the same mean, which
  /// is shorter than 1. Zero where a ray leaves the scene.
  Vec3 normal = Vec3::Zero();
  /// Distance of the first surface, specular or not, along the axis of the camera, in the units of the scene file;
  /// surfaces through which everything passes straight are skipped. kNoDepth where there is none.
  float depth = 0;
};

/// The depth of a pixel in which no surface is seen; as in Blender.
inline constexpr float kNoDepth = 1e10f;

Features featuresAlong(const RenderScene& scene, const RayCamera& camera, const Ray& ray, EmitterVisibility visibility);

/// Accumulates as many features of each pixel as a picture has samples.
class FeatureFilm {
 public:
  FeatureFilm(int width, int height)
      : width_(width), height_(height), pixels_(static_cast<std::size_t>(width) * height) {}

  /// Adds to each pixel the number of samples that the film, of the same size, has more. options: those with which the
  /// picture is rendered. Throws LoopCancelled if an enclosing loop or task is cancelled.
  void addMissing(const Film& film, const RenderScene& scene, const RayCamera& camera, const RenderOptions& options);

  /// Means over the samples of each pixel; zero without samples.
  Image albedo() const;
  Image normal() const;
  /// The smallest depth among the samples of each pixel, in all channels. A mean would be a distance at which nothing
  /// is where a pixel shows two surfaces.
  Image depth() const;

 private:
  struct Pixel {
    Eigen::Array3d albedo = Eigen::Array3d::Zero(), normal = Eigen::Array3d::Zero();
    float depth = kNoDepth;
    std::uint32_t samples = 0;
  };
  template <class Value>
  Image map(const Value& value) const;

  int width_, height_;
  std::vector<Pixel> pixels_;
};

}  // namespace lobe
