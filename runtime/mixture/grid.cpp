#include "runtime/mixture/grid.h"

#include <limits>
#include <numbers>

namespace lobe {

namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kGolden = std::numbers::phi;

// ---- Elevations

double elevation(int index, int count) {
  const double t = (index + 0.5) / count, v = 1 - t;
  return 0.5 * kPi * (0.5 * t + 0.5 * (1 - v * v * v));
}

// With v = 1 − t the spacing is v³ + v = 2 − 4θ/π. Newton's method starts from half the right-hand side, which is exact
// at both ends; four iterations converge to within a hundredth of any grid's step.
double invertedSpacing(double theta) {
  const double right = std::clamp(2 - 4 * theta / kPi, 0.0, 2.0);
  double v = 0.5 * right;
  for (int i = 0; i < 4; ++i) v -= (v * v * v + v - right) / (3 * v * v + 1);
  return 1 - v;
}

int nearestElevation(const Vec3& w, int count) {
  const double theta = std::atan2(std::hypot(w.x(), w.y()), w.z());
  const int guess = std::clamp(static_cast<int>(invertedSpacing(theta) * count), 0, count - 1);
  int best = guess;
  for (const int i : {guess - 1, guess + 1}) {
    if (i < 0 || i >= count) continue;
    if (std::abs(elevation(i, count) - theta) < std::abs(elevation(best, count) - theta)) best = i;
  }
  return best;
}

// ---- Spherical Fibonacci points. The points of the upper hemisphere are the first half of the 2·count points of the
// whole sphere in Keinert et al. 2015, "Spherical Fibonacci Mapping".

double fraction(double x) {
  return x - std::floor(x);
}

double fibonacciAzimuth(double index) {
  return 2 * kPi * fraction(index * (kGolden - 1));
}

Vec3 fibonacciDirection(int index, int count) {
  const double z = 1 - (index + 0.5) / count, phi = fibonacciAzimuth(index);
  const double sine = std::sqrt(std::max(0.0, 1 - z * z));
  return {static_cast<float>(sine * std::cos(phi)), static_cast<float>(sine * std::sin(phi)), static_cast<float>(z)};
}

// Finds the nearest of the entries offered to it.
struct Nearest {
  const Vec3& w;
  int count;
  int index = 0;
  float distance = std::numeric_limits<float>::infinity();
  void offer(int i) {
    const float d = (fibonacciDirection(i, count) - w).squaredNorm();
    if (d < distance || (d == distance && i < index)) distance = d, index = i;
  }
};

// The lattice that the points form near a latitude, in (azimuth, height). Its basis vectors are the steps from a point
// to those whose indices are larger by two consecutive Fibonacci numbers, which are its nearest neighbours there.
struct Lattice {
  double step[2][2];  // [which][azimuth, height]
};

Lattice latticeAt(double height, int count) {
  const double sine2 = 1 - height * height;
  const double order = std::log(2.0 * count * kPi * std::sqrt(5.0) * sine2) / std::log(kGolden * kGolden);
  const double k = std::max(2.0, std::floor(order));
  const double real = std::pow(kGolden, k) / std::sqrt(5.0);
  Lattice lattice{};
  const double fibonacci[2] = {std::round(real), std::round(real * kGolden)};
  for (int i = 0; i < 2; ++i) {
    const double turns = fibonacci[i] * (kGolden - 1);
    lattice.step[i][0] = 2 * kPi * (turns - std::round(turns));
    lattice.step[i][1] = -fibonacci[i] / count;
  }
  return lattice;
}

int nearestFibonacci(const Vec3& w, int count) {
  Nearest nearest{w, count};
  constexpr int kFewEntries = 16;
  if (count <= kFewEntries) {
    for (int i = 0; i < count; ++i) nearest.offer(i);
    return nearest.index;
  }
  const double height = std::clamp(static_cast<double>(w.z()), 0.0, 1.0);
  const Lattice lattice = latticeAt(height, count);
  const auto& [a, b] = lattice.step;
  const double x = std::atan2(w.y(), w.x()), y = height - (1 - 0.5 / count);
  const double inverse = 1 / (a[0] * b[1] - a[1] * b[0]);
  const double ca = std::floor((x * b[1] - y * b[0]) * inverse), cb = std::floor((y * a[0] - x * a[1]) * inverse);
  // The nearest point is a corner of the lattice cell, except at the equator, where corners may lie in the lower
  // hemisphere. One more ring of cells is searched there.
  const double reach = std::abs(a[1]) + std::abs(b[1]);
  const int ring = height < 2 * reach ? 1 : 0;
  for (int i = -ring; i <= 1 + ring; ++i) {
    for (int j = -ring; j <= 1 + ring; ++j) {
      double z = (ca + i) * a[1] + (cb + j) * b[1] + (1 - 0.5 / count);
      z = 2 * std::clamp(z, -1.0, 1.0) - z;  // reflected at the pole
      const int index = static_cast<int>(std::floor((1 - z) * count));
      if (index >= 0 && index < count) nearest.offer(index);
    }
  }
  return nearest.index;
}

}  // namespace

Vec3 DirectionGrid::direction(int index) const {
  if (kind == GridKind::fibonacci) return fibonacciDirection(index, count);
  const double theta = elevation(index, count);
  return {static_cast<float>(std::sin(theta)), 0.0f, static_cast<float>(std::cos(theta))};
}

int DirectionGrid::nearest(const Vec3& w) const {
  return kind == GridKind::fibonacci ? nearestFibonacci(w, count) : nearestElevation(w, count);
}

}  // namespace lobe
