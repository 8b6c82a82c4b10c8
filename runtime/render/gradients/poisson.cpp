#include "runtime/render/gradients/poisson.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>

namespace lobe {
namespace {

using Channels = Eigen::Matrix<double, Eigen::Dynamic, 3>;  // a row for each pixel
using Matrix = Eigen::SparseMatrix<double>;
using Solver = Eigen::ConjugateGradient<Matrix, Eigen::Lower | Eigen::Upper,
                                        Eigen::IncompleteCholesky<double, Eigen::Lower, Eigen::NaturalOrdering<int>>>;

// Relative residuals of the last and of the other solutions.
constexpr double kTolerance = 1e-7, kRoughTolerance = 1e-3;

// Iteratively reweighted least squares: a residual r has the weight 1 / (|r| + ε) with a decreasing ε, relative to the
// mean of the image.
constexpr int kReweightings = 12;
constexpr double kFirstEpsilon = 0.05, kDecrease = 0.5, kLeastEpsilon = 1e-4;

/// A term weight · (I(second) − I(first) − difference)² of the objective.
struct Edge {
  int first, second;
  Rgb difference;
  double weight = 1;
};

/// The objective in least squares, and its solution so far.
class Problem {
 public:
  Problem(const Image& pixels, const Image& dx, const Image& dy)
      : pixels_(pixels), pixelWeights_(pixels.pixels.size(), kScreening * kScreening) {
    for (int y = 0; y < pixels.height; ++y)
      for (int x = 0; x < pixels.width; ++x) {
        const int i = y * pixels.width + x;
        if (x + 1 < pixels.width) edges_.push_back({i, i + 1, dx.at(x, y)});
        if (y + 1 < pixels.height) edges_.push_back({i, i + pixels.width, dy.at(x, y)});
      }
    solution_.resize(unknowns(), 3);
    for (int i = 0; i < unknowns(); ++i) solution_.row(i) = row(pixels.pixels[i]);
  }

  void solve(double tolerance) {
    const Matrix system = matrix();
    Solver solver(system);
    solver.setTolerance(tolerance);
    const Channels next = solver.solveWithGuess(rightSide(), solution_);
    solution_ = next;
  }

  /// Weights for least absolute deviations from the solution so far.
  void reweight(double epsilon) {
    for (int i = 0; i < unknowns(); ++i)
      pixelWeights_[i] = kScreening / (kScreening * distance(solution(i), pixels_.pixels[i]) + epsilon) * kScreening;
    for (Edge& edge : edges_)
      edge.weight = 1 / (distance(solution(edge.second) - solution(edge.first), edge.difference) + epsilon);
  }

  Image image() const {
    Image result(pixels_.width, pixels_.height);
    for (int i = 0; i < unknowns(); ++i) result.pixels[i] = solution(i).cast<float>();
    return result;
  }

 private:
  int unknowns() const { return static_cast<int>(pixels_.pixels.size()); }
  Eigen::Array3d solution(int i) const { return solution_.row(i).transpose().array(); }
  static Eigen::RowVector3d row(const Rgb& colour) { return colour.cast<double>().matrix().transpose(); }
  static double distance(const Eigen::Array3d& a, const Rgb& b) { return (a - b.cast<double>()).matrix().norm(); }

  /// The normal equations.
  Matrix matrix() const {
    std::vector<Eigen::Triplet<double>> entries;
    entries.reserve(pixelWeights_.size() + 4 * edges_.size());
    for (int i = 0; i < unknowns(); ++i) entries.emplace_back(i, i, pixelWeights_[i]);
    for (const Edge& edge : edges_) {
      entries.emplace_back(edge.first, edge.first, edge.weight);
      entries.emplace_back(edge.second, edge.second, edge.weight);
      entries.emplace_back(edge.first, edge.second, -edge.weight);
      entries.emplace_back(edge.second, edge.first, -edge.weight);
    }
    Matrix result(unknowns(), unknowns());
    result.setFromTriplets(entries.begin(), entries.end());
    return result;
  }

  Channels rightSide() const {
    Channels result(unknowns(), 3);
    for (int i = 0; i < unknowns(); ++i) result.row(i) = pixelWeights_[i] * row(pixels_.pixels[i]);
    for (const Edge& edge : edges_) {
      result.row(edge.second) += edge.weight * row(edge.difference);
      result.row(edge.first) -= edge.weight * row(edge.difference);
    }
    return result;
  }

  const Image& pixels_;
  std::vector<Edge> edges_;
  std::vector<double> pixelWeights_;
  Channels solution_;
};

double meanOf(const Image& image) {
  double sum = 0;
  for (const Rgb& pixel : image.pixels) sum += pixel.mean();
  return sum / static_cast<double>(image.pixels.size());
}

}  // namespace

Image reconstruct(const Image& pixels, const Image& dx, const Image& dy, ReconstructionNorm norm) {
  const double scale = std::abs(meanOf(pixels));
  Problem problem(pixels, dx, dy);
  if (norm == ReconstructionNorm::l1 && scale > 0) {
    problem.solve(kRoughTolerance);
    for (int i = 0; i < kReweightings; ++i) {
      problem.reweight(scale * std::max(kLeastEpsilon, kFirstEpsilon * std::pow(kDecrease, i)));
      if (i + 1 < kReweightings) problem.solve(kRoughTolerance);
    }
  }
  problem.solve(kTolerance);
  return problem.image();
}

}  // namespace lobe
