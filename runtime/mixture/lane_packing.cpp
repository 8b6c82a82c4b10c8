#include "runtime/mixture/lane_packing.h"

#include <numbers>

namespace lobe {

void packLane(const Gaussian& g, float* data, int stride, int k) {
  const auto put = [&](LaneField f, double value) {
    data[static_cast<int>(f) * stride + k] = static_cast<float>(value);
  };
  // In double: of long thin lobes nearly all digits of the determinant cancel.
  const double xx = g.cov.xx, xy = g.cov.xy, yy = g.cov.yy;
  const double determinant = xx * yy - xy * xy;
  put(LaneField::x, g.meanX);
  put(LaneField::y, g.meanY);
  put(LaneField::slope, xy / xx);
  put(LaneField::along, -kHalfLog2e / xx);
  put(LaneField::across, -kHalfLog2e * xx / determinant);
  put(LaneField::scale, g.weight * 0.5 * std::numbers::inv_pi / std::sqrt(determinant));
  put(LaneField::xx, xx);
  put(LaneField::conditional, determinant / xx);
  put(LaneField::xy, xy);
  put(LaneField::yy, yy);
  put(LaneField::weight, g.weight);
}

void packLanes(std::span<const Gaussian> mixture, float* data, int stride) {
  const int count = static_cast<int>(mixture.size());
  for (int k = 0; k < count; ++k) packLane(mixture[static_cast<std::size_t>(k)], data, stride, k);
  for (int k = count; k < stride; ++k) packLane({0, 0, 0, {1, 0, 1}}, data, stride, k);
}

Gaussian gaussianAt(const LanesView& lanes, int k) {
  const auto at = [&](LaneField f) { return lanes.field(f)[k]; };
  return {at(LaneField::weight), at(LaneField::x), at(LaneField::y),
          Covariance{at(LaneField::xx), at(LaneField::xy), at(LaneField::yy)}};
}

Mixture unpackLanes(const LanesView& lanes) {
  Mixture mixture;
  mixture.reserve(static_cast<std::size_t>(lanes.count));
  for (int k = 0; k < lanes.count; ++k) mixture.push_back(gaussianAt(lanes, k));
  return mixture;
}

}  // namespace lobe
