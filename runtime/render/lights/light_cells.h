#pragma once
// Probabilities of choosing clusters of lights, learnt for cells of positions and normals (after Vévoda et al. 2018,
// "Bayesian online regression for adaptive direct illumination sampling").

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "runtime/render/lights/light_tree.h"

namespace lobe {

/// What one light sample found.
struct LightObservation {
  LightReceiver at;
  std::uint32_t cluster;
  float square;  ///< (contribution / importance)², with the unoccluded importance of the cluster at the receiver
};

class LightCells {
 public:
  /// Estimate of the unoccluded contribution of a cluster at a receiver.
  using Importance = std::function<float(int cluster, const LightReceiver& at)>;

  LightCells() = default;
  /// Divides the observations into cells of similar positions and normals. In each cell, the probability of a cluster
  /// is proportional to the root of the second moment of its contribution, which minimises the variance of the sum over
  /// clusters; a part of it is left to the probabilities of `prior`. The moments of a cell with few observations are
  /// drawn towards those of the larger cell around it. length: a distance of positions that separates as much as
  /// orthogonal normals do.
  LightCells(std::vector<LightObservation> observations, std::span<const float> prior, const Importance& importance,
             float length);

  bool empty() const { return nodes_.empty(); }
  int cells() const { return static_cast<int>(table_.size()) / stride_; }
  /// Cumulative probabilities of the clusters at a receiver, beginning with 0 and ending with 1. Must not be called if
  /// empty().
  const float* find(const LightReceiver& at) const;

 private:
  friend class LightCellBuilder;
  struct Node {
    float split;
    int axis;   // 0 to 2: of the position, 3 to 5: of the normal; −1: a cell
    int below;  // index of the first of two children, or of the cell
  };
  std::vector<Node> nodes_;
  std::vector<float> table_;
  int stride_ = 1;
};

/// Cumulative sums of probabilities that sum to one, beginning with 0; positive ones are at least 10⁻⁶.
std::vector<float> cumulative(std::span<const double> probabilities);

}  // namespace lobe
