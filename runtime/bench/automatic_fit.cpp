#include "runtime/bench/automatic_fit.h"

#include <array>
#include <numbers>
#include <stdexcept>

#include <ceres/ceres.h>
#include <glog/logging.h>

namespace lobe {
namespace {

// Keeps residuals finite where all components underflow.
constexpr double kLeastDensity = 1e-30;

template <class T>
struct Component {
  T weight, x, y, xx, xy, yy;  // xx, xy, yy of Σ⁻¹; weight includes the normalisation of the Gaussian
};

template <class T>
Component<T> componentOf(const T* p, const T& weight, double area) {
  using std::exp, std::sqrt;
  const T l11 = exp(p[3]), l21 = p[4], l22 = exp(p[5]);
  const T xx = l11 * l11 + kLeastVariance, xy = l11 * l21, yy = l21 * l21 + l22 * l22 + kLeastVariance;
  const T det = xx * yy - xy * xy;
  return {weight * (0.5 * std::numbers::inv_pi / area) / sqrt(det), p[1], p[2], yy / det, -xy / det, xx / det};
}

template <int components>
class Residuals {
 public:
  explicit Residuals(const FitPoints& points) : points_(points) {}

  template <class T>
  bool operator()(const T* parameters, T* residuals) const {
    using std::exp, std::sqrt;
    std::array<Component<T>, components> mixture;
    T sum(0);
    for (int k = 0; k < components; ++k) sum += exp(parameters[kComponentParameters * k]);
    const double area = points_.whitening.factor.diagonal().prod();
    for (int k = 0; k < components; ++k) {
      const T* p = parameters + kComponentParameters * k;
      mixture[static_cast<std::size_t>(k)] = componentOf<T>(p, exp(p[0]) / sum, area);
    }
    for (Eigen::Index i = 0; i < points_.size(); ++i) {
      T density(kLeastDensity);
      for (const Component<T>& c : mixture) {
        const T dx = points_.x[i] - c.x, dy = points_.y[i] - c.y;
        density += c.weight * exp(-0.5 * (c.xx * dx * dx + 2.0 * c.xy * dx * dy + c.yy * dy * dy));
      }
      residuals[i] = sqrt(points_.weight[i]) * (1.0 - points_.target[i] / density);
    }
    return true;
  }

 private:
  const FitPoints& points_;
};

template <int components>
void solve(const FitPoints& points, Eigen::VectorXd& parameters) {
  using Cost = ceres::AutoDiffCostFunction<Residuals<components>, ceres::DYNAMIC, kComponentParameters * components>;
  ceres::Problem problem;
  problem.AddResidualBlock(new Cost(new Residuals<components>(points), static_cast<int>(points.size())), nullptr,
                           parameters.data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
}

}  // namespace

Mixture refineAutomatically(const FitPoints& points, std::span<const Gaussian> start) {
  // Ceres correctly rejects steps that overflow, but prints a page of warnings for each.
  FLAGS_minloglevel = google::GLOG_FATAL;
  Eigen::VectorXd parameters = toParameters(start, points.whitening);
  switch (start.size()) {
    case 1:
      solve<1>(points, parameters);
      break;
    case 2:
      solve<2>(points, parameters);
      break;
    case 4:
      solve<4>(points, parameters);
      break;
    case 8:
      solve<8>(points, parameters);
      break;
    default:
      throw std::runtime_error("the fit with automatic derivatives supports 1, 2, 4 or 8 components only");
  }
  const std::span<const double> found(parameters.data(), static_cast<std::size_t>(parameters.size()));
  return toMixture(fromParameters(found, points.whitening), points.whitening);
}

}  // namespace lobe
