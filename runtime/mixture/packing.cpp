#include "runtime/mixture/packing.h"

#include <numbers>

namespace lobe {

void packGaussian(const Gaussian& g, float* data, int stride, int k) {
  const auto put = [&](GaussianField f, double value) {
    data[static_cast<int>(f) * stride + k] = static_cast<float>(value);
  };
  // In double precision, because the terms of the determinant nearly cancel for elongated Gaussians.
  const double xx = g.cov.xx, xy = g.cov.xy, yy = g.cov.yy;
  const double determinant = xx * yy - xy * xy;
  put(GaussianField::x, g.meanX);
  put(GaussianField::y, g.meanY);
  put(GaussianField::slope, xy / xx);
  put(GaussianField::along, -kHalfLog2e / xx);
  put(GaussianField::across, -kHalfLog2e * xx / determinant);
  put(GaussianField::scale, g.weight * 0.5 * std::numbers::inv_pi / std::sqrt(determinant));
  put(GaussianField::xx, xx);
  put(GaussianField::conditional, determinant / xx);
  put(GaussianField::xy, xy);
  put(GaussianField::yy, yy);
  put(GaussianField::weight, g.weight);
}

void packGaussians(std::span<const Gaussian> mixture, float* data, int stride) {
  const int count = static_cast<int>(mixture.size());
  for (int k = 0; k < count; ++k) packGaussian(mixture[static_cast<std::size_t>(k)], data, stride, k);
  for (int k = count; k < stride; ++k) packGaussian({0, 0, 0, {1, 0, 1}}, data, stride, k);
}

Gaussian gaussianAt(const GaussiansView& lanes, int k) {
  const auto at = [&](GaussianField f) { return lanes.field(f)[k]; };
  return {at(GaussianField::weight), at(GaussianField::x), at(GaussianField::y),
          Covariance{at(GaussianField::xx), at(GaussianField::xy), at(GaussianField::yy)}};
}

Mixture unpackGaussians(const GaussiansView& lanes) {
  Mixture mixture;
  mixture.reserve(static_cast<std::size_t>(lanes.count));
  for (int k = 0; k < lanes.count; ++k) mixture.push_back(gaussianAt(lanes, k));
  return mixture;
}

}  // namespace lobe
