#pragma once
// Accumulates the samples of gradient-domain path tracing: the pixels, and their differences from their neighbours.

#include <array>
#include <vector>

#include "runtime/render/film/film.h"
#include "runtime/render/gradients/poisson.h"

namespace lobe {

/// The neighbours of a pixel, in the order of GradientSample::differences.
inline constexpr std::array<std::array<int, 2>, 4> kNeighbours{{{1, 0}, {-1, 0}, {0, 1}, {0, -1}}};

/// One sample of a pixel.
struct GradientSample {
  /// Without emission that the camera sees directly.
  Rgb radiance = Rgb::Zero();
  /// That emission. It has no differences: its only noise is that of the edges of lights, which the reconstruction
  /// would spread over the neighbourhood of a bright light.
  Rgb visible = Rgb::Zero();
  /// Of the pixel and each neighbour: the part of their difference, pixel minus neighbour, that paths of this pixel
  /// estimate. The expected differences of the pixels a and b are those from a, minus those from b.
  std::array<Rgb, 4> differences{Rgb::Zero(), Rgb::Zero(), Rgb::Zero(), Rgb::Zero()};

  GradientSample operator+(const GradientSample& other) const {
    GradientSample sum = *this;
    sum.radiance += other.radiance;
    sum.visible += other.visible;
    for (std::size_t i = 0; i < differences.size(); ++i) sum.differences[i] += other.differences[i];
    return sum;
  }
};

/// An image that is reconstructed from its differences, with the emission that the camera sees directly.
struct ReconstructedImage {
  Image image;  ///< not negative
  /// Negative pixels were replaced by zero: what this has added to the image, as a fraction of its sum.
  double clampedFraction;
};

class GradientFilm {
 public:
  GradientFilm(int width, int height)
      : pixels_(width, height), visible_(pixels_.pixels().size(), Eigen::Array3d::Zero()), sums_(visible_.size()) {}

  /// Samples with a component that is not finite, or a negative radiance, are dropped and counted. Threads may write
  /// different pixels concurrently.
  void add(int x, int y, const GradientSample& sample);

  /// The samples without their differences, of all light.
  const Film& pixels() const { return pixels_; }
  /// The means of GradientSample::radiance and of GradientSample::visible.
  Image mean() const;
  Image visible() const;
  /// The mean differences of each pixel's right, or lower, neighbour from the pixel; zero in the last column, or row.
  Image dx() const { return differences(0); }
  Image dy() const { return differences(2); }

  ReconstructedImage reconstruct(ReconstructionNorm norm) const;

 private:
  using Sums = std::array<Eigen::Array3d, 4>;

  Image differences(std::size_t direction) const;
  Eigen::Array3d meanDifference(int x, int y, std::size_t direction) const;
  Eigen::Array3d meanOf(const Eigen::Array3d& sum, int x, int y) const;
  std::size_t indexOf(int x, int y) const { return static_cast<std::size_t>(y) * pixels_.width() + x; }

  Film pixels_;
  std::vector<Eigen::Array3d> visible_;  // sums
  std::vector<Sums> sums_;               // of the differences
};

}  // namespace lobe
