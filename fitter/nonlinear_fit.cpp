#include "fitter/nonlinear_fit.h"

#include <cmath>

#include <ceres/tiny_solver.h>

#include "fitter/lobe_draws.h"
#include "runtime/core/low_discrepancy.h"

namespace lobe {
namespace {

// A point of a fit, before conversion to arrays.
struct Point {
  Vec2 y;
  double value;  // ρ
  double pdf;    // q over the disc
  double cosine;
  double weight;
};

constexpr double kStartFraction = 0.5;

constexpr std::uint32_t kCoarseFraction = 4;
constexpr double kCoarseTolerance = 10;

std::vector<Point> ownPoints(const Lobe& lobe, const Vec3& wo, std::uint32_t count) {
  std::vector<Point> points;
  for (const LobeDraw& d : drawLobe(lobe, wo, 0, count))
    points.push_back({toDisc(d.wi), d.value, 2 * d.pdf, d.wi.z(), 1.0 / count});
  return points;
}

void addStartPoints(const Lobe& lobe, const Vec3& wo, std::span<const Gaussian> start, std::uint32_t count,
                    std::vector<Point>& points) {
  for (std::uint32_t i = 0; i < count; ++i) {
    const Eigen::Vector3f u = cubePoint(i);
    const Vec2 y = sampleMixture(start, u.x(), u.tail<2>());
    if (!insideDisc(y)) continue;
    const Vec3 wi = fromDisc(y);
    points.push_back({y, lobeValue(lobe, wo, wi), 2 * lobe.pdf(wo, wi), wi.z(), 0});
  }
}

/// Balance heuristic: the weight is the reciprocal of the summed density of all points.
void balance(std::span<const Gaussian> start, double own, double guided, std::vector<Point>& points) {
  for (Point& p : points) p.weight = 1 / (own * p.pdf + guided * mixturePdf(start, p.y));
}

Whitening whiteningOf(const std::vector<Point>& points, bool overArea) {
  const auto mass = [overArea](const Point& p) { return p.value * p.weight / (overArea ? 1 : p.pdf); };
  double sum = 0;
  Whitening w;
  for (const Point& p : points) sum += mass(p), w.centre += mass(p) * p.y.cast<double>();
  w.centre /= sum;
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  for (const Point& p : points) {
    const Eigen::Vector2d d = p.y.cast<double>() - w.centre;
    covariance += mass(p) / sum * d * d.transpose();
  }
  w.factor(0, 0) = std::sqrt(covariance(0, 0));
  w.factor(1, 0) = covariance(1, 0) / w.factor(0, 0);
  w.factor(1, 1) = std::sqrt(covariance.determinant()) / w.factor(0, 0);
  return w;
}

FitPoints asArrays(const std::vector<Point>& points, bool product) {
  FitPoints a;
  a.whitening = whiteningOf(points, product);
  const auto count = static_cast<Eigen::Index>(points.size());
  for (Eigen::ArrayXd* array : {&a.x, &a.y, &a.target, &a.ownPdf, &a.cosine, &a.weight}) array->resize(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Point& p = points[static_cast<std::size_t>(i)];
    const Eigen::Vector2d z = a.whitening.inverse(p.y.cast<double>());
    a.x[i] = z.x();
    a.y[i] = z.y();
    a.target[i] = p.value * (product ? p.cosine : 1);
    a.ownPdf[i] = p.pdf;
    a.cosine[i] = p.cosine;
    a.weight[i] = p.weight;
  }
  a.target /= product ? (a.target * a.weight).sum() : (a.target * a.weight / a.ownPdf).sum();
  return a;
}

/// Whether the points span a two-dimensional area.
bool wide(const Whitening& w) {
  constexpr double kNarrowest = 1e-6;
  return w.factor.diagonal().minCoeff() > kNarrowest;
}

}  // namespace

FitPoints fitPoints(const Lobe& lobe, const Vec3& wo, std::span<const Gaussian> start,
                    const NonlinearFitOptions& options) {
  if (options.objective == FitObjective::reflectance) {
    const std::vector<Point> points = ownPoints(lobe, wo, options.points);
    return points.empty() ? FitPoints{} : asArrays(points, false);
  }
  const auto guided = static_cast<std::uint32_t>(kStartFraction * options.points), own = options.points - guided;
  std::vector<Point> points = ownPoints(lobe, wo, own);
  if (points.empty()) return {};
  addStartPoints(lobe, wo, start, guided, points);
  balance(start, own, guided, points);
  return asArrays(points, true);
}

namespace {

/// Runs Levenberg–Marquardt on points drawn for this start.
NonlinearFit solved(const Lobe& lobe, const Vec3& wo, std::span<const Gaussian> start,
                    const NonlinearFitOptions& options) {
  NonlinearFit fit{{start.begin(), start.end()}};
  const FitPoints points = fitPoints(lobe, wo, start, options);
  const FitResiduals residuals(options.objective, points, start.size());
  if (points.size() < residuals.NumParameters() || !wide(points.whitening)) return fit;
  Eigen::VectorXd parameters = toParameters(start, points.whitening);
  ceres::TinySolver<FitResiduals> solver;
  solver.options.max_num_iterations = options.maxIterations;
  solver.options.function_tolerance = options.tolerance;
  const auto& summary = solver.Solve(residuals, &parameters);
  fit.iterations = summary.iterations;
  fit.startCost = 2 * summary.initial_cost;
  fit.cost = 2 * summary.final_cost;
  if (!(fit.cost < fit.startCost) || !parameters.allFinite()) return fit;
  fit.mixture =
      toMixture(fromParameters({parameters.data(), static_cast<std::size_t>(parameters.size())}, points.whitening),
                points.whitening);
  return fit;
}

}  // namespace

NonlinearFit refineMixture(const Lobe& lobe, const Vec3& wo, std::span<const Gaussian> start,
                           const NonlinearFitOptions& options) {
  // A first solve on few points does most of the work at a fraction of the cost.
  NonlinearFitOptions coarse = options;
  coarse.points /= kCoarseFraction;
  coarse.tolerance *= kCoarseTolerance;
  const NonlinearFit first = solved(lobe, wo, start, coarse);
  NonlinearFit second = solved(lobe, wo, first.mixture, options);
  second.iterations += first.iterations;
  if (first.iterations > 0) second.startCost = first.startCost;
  return second;
}

}  // namespace lobe
