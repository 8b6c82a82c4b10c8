#include "runtime/render/lights/light_cells.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace lobe {
namespace {

using Iterator = std::vector<LightObservation>::iterator;

constexpr int kAxes = 6;
/// Of the prior, in the probabilities of a cell.
constexpr double kDefensive = 0.2;
/// The weight of the moments of the larger cell, in observations.
constexpr double kShrinkage = 4;
/// Receivers of a cell at which the importance of clusters is averaged.
constexpr int kRepresentatives = 8;
constexpr int kMaxDepth = 16;

float coordinate(const LightReceiver& at, int axis) {
  return axis < 3 ? at.position[axis] : at.normal[axis - 3];
}

/// Second moments of contribution / importance by cluster.
using Moments = std::vector<double>;

}  // namespace

class LightCellBuilder {
 public:
  LightCellBuilder(LightCells& cells, std::span<const float> prior, const LightCells::Importance& importance,
                   float length)
      : cells_(cells), prior_(prior), importance_(importance), length_(length) {
    cells_.stride_ = static_cast<int>(prior.size()) + 1;
    leastObservations_ = std::max<std::ptrdiff_t>(64, 2 * static_cast<std::ptrdiff_t>(prior.size()));
  }

  void build(std::vector<LightObservation>& observations) {
    double sum = 0;
    for (const LightObservation& o : observations) sum += o.square;
    const Moments all(prior_.size(), sum / static_cast<double>(observations.size()));
    cells_.nodes_.push_back({});
    build(0, observations.begin(), observations.end(), all, 0);
  }

 private:
  struct Split {
    int axis = -1;
    float position = 0;
  };

  void build(int node, Iterator first, Iterator last, const Moments& above, int depth) {
    const Moments moments = momentsOf(first, last, above);
    const Split split = depth < kMaxDepth && last - first >= 2 * leastObservations_ ? splitOf(first, last) : Split{};
    const Iterator middle = split.axis < 0 ? first : std::partition(first, last, [&](const LightObservation& o) {
      return coordinate(o.at, split.axis) < split.position;
    });
    if (middle == first || middle == last) {
      cells_.nodes_[node] = {0, -1, addCell(first, last, moments)};
      return;
    }
    const auto below = static_cast<int>(cells_.nodes_.size());
    cells_.nodes_[node] = {split.position, split.axis, below};
    cells_.nodes_.resize(cells_.nodes_.size() + 2);
    build(below, first, middle, moments, depth + 1);
    build(below + 1, middle, last, moments, depth + 1);
  }

  Moments momentsOf(Iterator first, Iterator last, const Moments& above) const {
    Moments sums(above.size());
    std::vector<int> counts(above.size());
    for (Iterator i = first; i != last; ++i) {
      sums[i->cluster] += i->square;
      ++counts[i->cluster];
    }
    for (std::size_t k = 0; k < sums.size(); ++k)
      sums[k] = (sums[k] + kShrinkage * above[k]) / (counts[k] + kShrinkage);
    return sums;
  }

  /// At the mean of the coordinate with the largest variance.
  Split splitOf(Iterator first, Iterator last) const {
    Split split;
    double largest = 0;
    for (int axis = 0; axis < kAxes; ++axis) {
      double sum = 0, squares = 0;
      const double origin = coordinate(first->at, axis);
      for (Iterator i = first; i != last; ++i) {
        const double x = coordinate(i->at, axis) - origin;
        sum += x;
        squares += x * x;
      }
      const double mean = sum / static_cast<double>(last - first);
      double variance = squares / static_cast<double>(last - first) - mean * mean;
      if (axis >= 3) variance *= static_cast<double>(length_) * length_;
      if (!(variance > largest)) continue;
      largest = variance;
      split = {axis, static_cast<float>(origin + mean)};
    }
    return split;
  }

  int addCell(Iterator first, Iterator last, const Moments& moments) {
    std::vector<double> probabilities(prior_.size());
    double sum = 0;
    for (std::size_t k = 0; k < probabilities.size(); ++k) {
      probabilities[k] = std::sqrt(moments[k] * squaredImportance(static_cast<int>(k), first, last));
      sum += probabilities[k];
    }
    for (std::size_t k = 0; k < probabilities.size(); ++k)
      probabilities[k] = sum > 0 && std::isfinite(sum)
                             ? (1 - kDefensive) * probabilities[k] / sum + kDefensive * prior_[k]
                             : prior_[k];
    const std::vector<float> row = cumulative(probabilities);
    cells_.table_.insert(cells_.table_.end(), row.begin(), row.end());
    return cells_.cells() - 1;
  }

  double squaredImportance(int cluster, Iterator first, Iterator last) const {
    const auto step = std::max<std::ptrdiff_t>(1, (last - first) / kRepresentatives);
    double sum = 0;
    int count = 0;
    for (std::ptrdiff_t i = 0; i < last - first; i += step, ++count) {
      const double value = importance_(cluster, first[i].at);
      sum += value * value;
    }
    return sum / count;
  }

  LightCells& cells_;
  std::span<const float> prior_;
  const LightCells::Importance& importance_;
  float length_;
  std::ptrdiff_t leastObservations_;
};

LightCells::LightCells(std::vector<LightObservation> observations, std::span<const float> prior,
                       const Importance& importance, float length) {
  if (observations.empty()) return;
  LightCellBuilder(*this, prior, importance, length).build(observations);
}

const float* LightCells::find(const LightReceiver& at) const {
  const std::array<float, kAxes> x{at.position.x(), at.position.y(), at.position.z(),
                                   at.normal.x(),   at.normal.y(),   at.normal.z()};
  const Node* node = nodes_.data();
  while (node->axis >= 0) node = &nodes_[node->below + (x[node->axis] < node->split ? 0 : 1)];
  return &table_[static_cast<std::size_t>(node->below) * stride_];
}

std::vector<float> cumulative(std::span<const double> probabilities) {
  // In single precision, smaller probabilities might vanish, and with them the light of a cluster.
  static constexpr double kLeast = 1e-6;
  const auto raised = [](double p) { return p > 0 ? std::max(p, kLeast) : 0.0; };
  double total = 0;
  for (const double p : probabilities) total += raised(p);
  std::vector<float> result{0};
  double sum = 0;
  for (const double p : probabilities) result.push_back(static_cast<float>(std::min(1.0, (sum += raised(p)) / total)));
  result.back() = 1;
  return result;
}

}  // namespace lobe
