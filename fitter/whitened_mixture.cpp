#include "fitter/whitened_mixture.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "runtime/mixture/eigenvalue_floor.h"

namespace lobe {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

constexpr double kLeastWeight = 1e-6;

/// L such that L Lᵀ is the positive definite matrix closest to covariance − kLeastVariance·I.
Matrix2d lowerFactor(const Matrix2d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Matrix2d> axes(covariance);
  const Vector2d variances = (axes.eigenvalues().array() - kLeastVariance).max(0.1 * kLeastVariance);
  const Matrix2d raised = axes.eigenvectors() * variances.asDiagonal() * axes.eigenvectors().transpose();
  Matrix2d lower = Matrix2d::Zero();
  lower(0, 0) = std::sqrt(raised(0, 0));
  lower(1, 0) = raised(1, 0) / lower(0, 0);
  lower(1, 1) = std::sqrt(variances.prod()) / lower(0, 0);
  return lower;
}

// Means must stay in the disc: beyond the radius kBend, the distance r of the parameters from the centre is mapped to
// kBend + kRoom t/(1 + t) with t = (r − kBend)/kRoom, which stays below 1 in single precision.
constexpr double kBend = 0.9, kRoom = 0.09999, kLargestRadius = 0.999;

/// Maps the unconstrained mean y into the disc; slope is the derivative.
Vector2d bent(const Vector2d& y, Matrix2d& slope) {
  const double r = y.norm();
  slope.setIdentity();
  if (r <= kBend) return y;
  const double t = (r - kBend) / kRoom, scale = (kBend + kRoom * t / (1 + t)) / r;
  const Matrix2d radial = y * y.transpose() / (r * r);
  slope = scale * (slope - radial) + radial / ((1 + t) * (1 + t));
  return scale * y;
}

Vector2d unbent(const Vector2d& mean) {
  const double r = std::min(mean.norm(), kLargestRadius);
  if (r <= kBend) return mean;
  const double s = (r - kBend) / kRoom;
  return mean.normalized() * (kBend + kRoom * s / (1 - s));
}

void setLower(double log11, double l21, double log22, WhitenedComponent& c) {
  const double largestLog = std::log(kLargestDeviation);
  c.lower << std::exp(std::min(log11, largestLog)), 0, std::clamp(l21, -kLargestDeviation, kLargestDeviation),
      std::exp(std::min(log22, largestLog));
  c.lowerSlope << (log11 < largestLog ? c.lower(0, 0) : 0), 0, (std::abs(l21) < kLargestDeviation ? 1 : 0),
      (log22 < largestLog ? c.lower(1, 1) : 0);
}

Matrix2d covarianceOf(const Gaussian& g) {
  Matrix2d covariance;
  covariance << g.cov.xx, g.cov.xy, g.cov.xy, g.cov.yy;
  return covariance;
}

}  // namespace

Vector2d Whitening::inverse(const Vector2d& y) const {
  const Vector2d d = y - centre;
  const double first = d.x() / factor(0, 0);
  return {first, (d.y() - factor(1, 0) * first) / factor(1, 1)};
}

std::vector<WhitenedComponent> fromParameters(std::span<const double> parameters, const Whitening& whitening) {
  std::vector<WhitenedComponent> components(parameters.size() / kComponentParameters);
  const Matrix2d inverse = whitening.factor.inverse();
  double largest = parameters[0], sum = 0;
  for (std::size_t k = 0; k < components.size(); ++k) largest = std::max(largest, parameters[kComponentParameters * k]);
  for (std::size_t k = 0; k < components.size(); ++k) {
    const double* p = parameters.data() + kComponentParameters * k;
    WhitenedComponent& c = components[k];
    c.weight = std::exp(p[0] - largest);
    c.mean = whitening.inverse(bent(whitening.centre + whitening.factor * Vector2d(p[1], p[2]), c.meanSlope));
    c.meanSlope = inverse * c.meanSlope * whitening.factor;
    setLower(p[3], p[4], p[5], c);
    c.covariance = c.lower * c.lower.transpose() + kLeastVariance * Matrix2d::Identity();
    sum += c.weight;
  }
  for (WhitenedComponent& c : components) c.weight /= sum;
  return components;
}

Eigen::VectorXd toParameters(std::span<const Gaussian> mixture, const Whitening& whitening) {
  Eigen::VectorXd parameters(kComponentParameters * static_cast<Eigen::Index>(mixture.size()));
  const Matrix2d inverse = whitening.factor.inverse();
  Eigen::Index at = 0;
  for (const Gaussian& g : mixture) {
    const Vector2d mean = whitening.inverse(unbent({g.meanX, g.meanY}));
    const Matrix2d lower = lowerFactor(inverse * covarianceOf(g) * inverse.transpose());
    parameters.segment<kComponentParameters>(at) << std::log(std::max<double>(g.weight, kLeastWeight)), mean.x(),
        mean.y(), std::log(lower(0, 0)), lower(1, 0), std::log(lower(1, 1));
    at += kComponentParameters;
  }
  return parameters;
}

Mixture toMixture(const std::vector<WhitenedComponent>& components, const Whitening& whitening) {
  Mixture mixture;
  for (const WhitenedComponent& c : components) {
    const Vector2d mean = whitening.centre + whitening.factor * c.mean;
    const Matrix2d v = whitening.factor * c.covariance * whitening.factor.transpose();
    mixture.push_back({static_cast<float>(c.weight), static_cast<float>(mean.x()), static_cast<float>(mean.y()),
                       withEigenvalueFloor(v(0, 0), v(1, 0), v(1, 1), 0)});
  }
  return mixture;
}

}  // namespace lobe
