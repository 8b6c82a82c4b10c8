#include "fitter/fit_residuals.h"

#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "fitter/lobe_fit.h"
#include "fitter/mass_slopes.h"

namespace lobe {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::Matrix2d;
using Eigen::Vector2d;

// Square root of the weight of the penalty for mass outside the disc.
const double kOutsidePenalty = std::sqrt(0.03);

// A component at all points: density N, and u = Σ⁻¹(z − mean), which the derivatives need.
struct ComponentAtPoints {
  Matrix2d inverse;
  ArrayXd u0, u1, density;

  ComponentAtPoints(const WhitenedComponent& c, const FitPoints& points)
      : inverse(c.covariance.inverse()),
        u0(inverse(0, 0) * (points.x - c.mean.x()) + inverse(0, 1) * (points.y - c.mean.y())),
        u1(inverse(1, 0) * (points.x - c.mean.x()) + inverse(1, 1) * (points.y - c.mean.y())) {
    const double scale =
        0.5 * std::numbers::inv_pi * std::sqrt(inverse.determinant()) / points.whitening.factor.diagonal().prod();
    density = scale * (-0.5 * (u0 * (points.x - c.mean.x()) + u1 * (points.y - c.mean.y()))).exp();
  }
};

// Derivatives with respect to the whitened mean and covariance.
MassSlope whitened(const MassSlope& mass, const Whitening& w) {
  return {mass.value, w.factor.transpose() * mass.byMean, w.factor.transpose() * mass.byCov * w.factor};
}

MassSlopes massesOf(const WhitenedComponent& c, const Whitening& w) {
  const Matrix2d factor = w.factor * c.covariance.llt().matrixL().toDenseMatrix();
  const MassSlopes masses = massSlopes(w.centre + w.factor * c.mean, factor);
  return {whitened(masses.inside, w), whitened(masses.cosine, w)};
}

struct State {
  std::vector<WhitenedComponent> components;
  std::vector<ComponentAtPoints> atPoints;
  std::vector<MassSlopes> masses;  // empty where the objective needs none
  ArrayXd density;                 // G
  double inside = 0, cosine = 0;   // ∫ G dA, ∫ G cosθ dA

  State(std::span<const double> parameters, const FitPoints& points, bool needsMass)
      : components(fromParameters(parameters, points.whitening)), density(ArrayXd::Zero(points.size())) {
    for (const WhitenedComponent& c : components) {
      atPoints.emplace_back(c, points);
      density += c.weight * atPoints.back().density;
      if (needsMass) addMass(c, points.whitening);
    }
  }
  void addMass(const WhitenedComponent& c, const Whitening& whitening) {
    masses.push_back(massesOf(c, whitening));
    inside += c.weight * masses.back().inside.value;
    cosine += c.weight * masses.back().cosine.value;
  }
};

// Six columns of the Jacobian.
using Columns = Eigen::Map<Eigen::MatrixXd>;

void densityDerivatives(const WhitenedComponent& c, const ComponentAtPoints& at, const ArrayXd& mixtureDensity,
                        const ArrayXd& slope, Columns& to) {
  // For Σ, dN = ½ N tr((u uᵀ − Σ⁻¹) dΣ), so the derivative with respect to L is N (u uᵀ − Σ⁻¹) L.
  const ArrayXd fraction = c.weight * slope * at.density;
  const Matrix2d sl = at.inverse * c.lower;
  const double l11 = c.lower(0, 0), l21 = c.lower(1, 0), l22 = c.lower(1, 1);
  const auto column = [&](Index i) { return to.col(i).head(fraction.size()).array(); };
  column(0) = fraction - c.weight * slope * mixtureDensity;
  column(1) = fraction * (at.u0 * c.meanSlope(0, 0) + at.u1 * c.meanSlope(1, 0));
  column(2) = fraction * (at.u0 * c.meanSlope(0, 1) + at.u1 * c.meanSlope(1, 1));
  column(3) = fraction * (at.u0 * (at.u0 * l11 + at.u1 * l21) - sl(0, 0)) * c.lowerSlope(0, 0);
  column(4) = fraction * (at.u1 * (at.u0 * l11 + at.u1 * l21) - sl(1, 0)) * c.lowerSlope(1, 0);
  column(5) = fraction * (at.u1 * at.u1 * l22 - sl(1, 1)) * c.lowerSlope(1, 1);
}

using Slopes = Eigen::Matrix<double, 1, kComponentParameters>;

// Derivatives of a mass of the mixture with respect to the parameters of one component.
Slopes massDerivatives(const WhitenedComponent& c, const MassSlope& mass, double mixtureMass) {
  const Matrix2d byLower = (2 * mass.byCov * c.lower).cwiseProduct(c.lowerSlope);
  const Vector2d byMean = c.meanSlope.transpose() * mass.byMean;
  Slopes slopes;
  slopes << mass.value - mixtureMass, byMean.x(), byMean.y(), byLower(0, 0), byLower(1, 0), byLower(1, 1);
  return c.weight * slopes;
}

using Residuals = Eigen::Map<ArrayXd>;

// sqrt(w) (f − p)/sqrt(p), with derivative −sqrt(w) (f + p)/(2 p^{3/2}) with respect to p; and the penalty.
void productResiduals(const State& s, const FitPoints& points, Residuals residuals, double* jacobian) {
  const double guided = (1 - kGradedBsdfFraction) / s.cosine;
  const ArrayXd p = kGradedBsdfFraction * points.ownPdf + guided * points.cosine * s.density;
  const ArrayXd scale = (points.weight / p).sqrt();
  const Index count = points.size(), rows = count + 1;
  residuals.head(count) = scale * (points.target - p);
  residuals[count] = kOutsidePenalty * (1 - s.inside);
  if (!jacobian) return;
  const ArrayXd byDensity = -0.5 * guided * scale * (points.target / p + 1) * points.cosine;
  const ArrayXd byCosine = -byDensity * s.density / s.cosine;
  for (std::size_t k = 0; k < s.components.size(); ++k) {
    const WhitenedComponent& c = s.components[k];
    Columns to(jacobian + rows * kComponentParameters * static_cast<Index>(k), rows, kComponentParameters);
    densityDerivatives(c, s.atPoints[k], s.density, byDensity, to);
    to.topRows(count) += byCosine.matrix() * massDerivatives(c, s.masses[k].cosine, s.cosine);
    to.row(count) = -kOutsidePenalty * massDerivatives(c, s.masses[k].inside, s.inside);
  }
}

// sqrt(w) (1 − ρ̂/G).
void reflectanceResiduals(const State& s, const FitPoints& points, Residuals residuals, double* jacobian) {
  const ArrayXd ratio = points.target / s.density, scale = points.weight.sqrt();
  residuals = scale * (1 - ratio);
  if (!jacobian) return;
  const ArrayXd byDensity = scale * ratio / s.density;
  for (std::size_t k = 0; k < s.components.size(); ++k) {
    Columns to(jacobian + points.size() * kComponentParameters * static_cast<Index>(k), points.size(),
               kComponentParameters);
    densityDerivatives(s.components[k], s.atPoints[k], s.density, byDensity, to);
  }
}

}  // namespace

bool FitResiduals::operator()(const double* parameters, double* residuals, double* jacobian) const {
  const bool product = objective_ == FitObjective::product;
  const State state({parameters, static_cast<std::size_t>(NumParameters())}, points_, product);
  (product ? productResiduals : reflectanceResiduals)(state, points_, Residuals(residuals, NumResiduals()), jacobian);
  return true;
}

}  // namespace lobe
