#include "runtime/mixture/kernels.h"

#include <cstddef>
#include <numbers>

// Includes this file once per instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "runtime/mixture/kernels.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep

#include <hwy/highway.h>

#include "runtime/mixture/kernel_math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lobe::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// The columns of pairs for one SIMD vector of the light's components, starting at `first`; returns their sums.
template <class D>
HWY_INLINE hn::Vec<D> pairColumns(D d, GaussiansView reflectance, float constant, GaussiansView light, int first,
                                  float* pairs) {
  const auto two = [&](GaussianField f) { return hn::LoadU(d, light.field(f) + first); };
  const auto x2 = two(GaussianField::x), y2 = two(GaussianField::y), slope2 = two(GaussianField::slope),
             xx2 = two(GaussianField::xx), xy2 = two(GaussianField::xy), weight2 = two(GaussianField::weight);
  const auto scale2 = hn::Mul(weight2, hn::Set(d, 0.5f * std::numbers::inv_pi_v<float>));
  const auto variance2 = two(GaussianField::conditional);
  auto sum = hn::Mul(hn::Set(d, constant), weight2);
  hn::StoreU(sum, d, pairs + std::ptrdiff_t{reflectance.count} * light.stride + first);
  for (int i = 0; i < reflectance.count; ++i) {
    const auto one = [&](GaussianField f) { return hn::Set(d, reflectance.field(f)[i]); };
    const auto xx1 = one(GaussianField::xx);
    const auto sxx = hn::Add(xx1, xx2), sxy = hn::Add(one(GaussianField::xy), xy2);
    const auto bend = hn::Sub(one(GaussianField::slope), slope2);
    const auto determinant = hn::MulAdd(hn::Add(one(GaussianField::conditional), variance2), sxx,
                                        hn::Mul(hn::Mul(xx1, xx2), hn::Mul(bend, bend)));
    const auto dx = hn::Sub(one(GaussianField::x), x2), dy = hn::Sub(one(GaussianField::y), y2);
    const auto across = hn::NegMulAdd(sxy, dx, hn::Mul(dy, sxx));  // (dy − slope dx) S_xx
    const auto height = reciprocalRoot(d, determinant);            // 1/sqrt|S|
    const auto lean = hn::Mul(across, height);
    const auto square = hn::Mul(reciprocal(d, sxx), hn::MulAdd(lean, lean, hn::Mul(dx, dx)));
    const auto weight = hn::Mul(hn::Mul(hn::Set(d, reflectance.field(GaussianField::weight)[i]), height), scale2);
    const auto mass = hn::Mul(weight, exp2Negative(d, hn::Mul(hn::Set(d, -kHalfLog2e), square)));
    hn::StoreU(mass, d, pairs + std::ptrdiff_t{i} * light.stride + first);
    sum = hn::Add(sum, mass);
  }
  return sum;
}

// Replaces the values by their running sums; returns the last. In sequence: in a tree of additions, rounding could make
// the sum after an empty value differ from that before it, and choosePair choose the empty value.
HWY_INLINE float sumUp(float* values, int count) {
  float sum = 0;
  for (int k = 0; k < count; ++k) values[k] = sum += values[k];
  return sum;
}

template <class D>
HWY_INLINE float pairMassesBy(D d, GaussiansView reflectance, float constant, GaussiansView light, float* pairs,
                              float* columns) {
  for (int j = 0; j < light.stride; j += static_cast<int>(hn::Lanes(d)))
    hn::StoreU(pairColumns(d, reflectance, constant, light, j, pairs), d, columns + j);
  return sumUp(columns, light.stride);
}

float pairMassesKernel(const GaussiansView& reflectance, float constant, const GaussiansView& light, float* pairs,
                       float* columns) {
  if (light.stride == kPaddingMultiple)
    return pairMassesBy(hn::CappedTag<float, kPaddingMultiple>(), reflectance, constant, light, pairs, columns);
  return pairMassesBy(hn::CappedTag<float, kMaxVectorLanes>(), reflectance, constant, light, pairs, columns);
}

// Without branches that depend on the random number, which would be mispredicted.
PairIndex choosePairKernel(const float* pairs, const float* columns, int rows, int stride, float choice) {
  const hn::CappedTag<float, kPaddingMultiple> d;
  float left = choice * columns[stride - 1];  // less than the total
  int column = 0;
  for (int j = 0; j < stride; j += kPaddingMultiple)
    column += static_cast<int>(hn::CountTrue(d, hn::Le(hn::LoadU(d, columns + j), hn::Set(d, left))));
  if (column > 0) left -= columns[column - 1];
  const float* masses = pairs + column;
  float sum = 0;
  int row = 0;
  for (int i = 0; i < rows; ++i) {
    sum += masses[std::ptrdiff_t{i} * stride];
    row += sum <= left ? 1 : 0;
  }
  // If rounding leaves a remainder at the end, the last pair with positive mass is chosen.
  while (row == rows || !(masses[std::ptrdiff_t{row} * stride] > 0)) --row;
  return {row, column};
}

template <class D>
HWY_INLINE hn::Vec<D> densityOf(D d, GaussiansView lanes, int first, hn::Vec<D> x, hn::Vec<D> y) {
  const auto at = [&](GaussianField f) { return hn::LoadU(d, lanes.field(f) + first); };
  const auto dx = hn::Sub(x, at(GaussianField::x));
  const auto dy = hn::NegMulAdd(at(GaussianField::slope), dx, hn::Sub(y, at(GaussianField::y)));
  const auto exponent =
      hn::MulAdd(hn::Mul(dx, dx), at(GaussianField::along), hn::Mul(hn::Mul(dy, dy), at(GaussianField::across)));
  return hn::Mul(at(GaussianField::scale), exp2Negative(d, exponent));
}

template <class D>
HWY_INLINE float lightDensityBy(D d, GaussiansView light, float px, float py) {
  const auto x = hn::Set(d, px), y = hn::Set(d, py);
  auto sum = hn::Zero(d);
  for (int j = 0; j < light.stride; j += static_cast<int>(hn::Lanes(d)))
    sum = hn::Add(sum, densityOf(d, light, j, x, y));
  return hn::GetLane(hn::SumOfLanes(d, sum));
}

HWY_INLINE float lightDensityAt(const GaussiansView& light, float x, float y) {
  if (light.stride == kPaddingMultiple) return lightDensityBy(hn::CappedTag<float, kPaddingMultiple>(), light, x, y);
  return lightDensityBy(hn::CappedTag<float, kMaxVectorLanes>(), light, x, y);
}

template <class D>
HWY_INLINE float reflectanceDensityBy(D d, GaussiansView reflectance, float px, float py) {
  const auto x = hn::Set(d, px), y = hn::Set(d, py);
  auto sum = hn::Zero(d);
  for (int i = 0; i < reflectance.count; i += static_cast<int>(hn::Lanes(d))) {
    const auto live = hn::FirstN(d, static_cast<std::size_t>(reflectance.count - i));
    sum = hn::Add(sum, hn::IfThenElseZero(live, densityOf(d, reflectance, i, x, y)));
  }
  return hn::GetLane(hn::SumOfLanes(d, sum));
}

HWY_INLINE float reflectanceDensityAt(const GaussiansView& reflectance, float x, float y) {
  if (reflectance.count == 0) return 0.0f;
  if (reflectance.count <= kPaddingMultiple)
    return reflectanceDensityBy(hn::CappedTag<float, kPaddingMultiple>(), reflectance, x, y);
  return reflectanceDensityBy(hn::CappedTag<float, kMaxVectorLanes>(), reflectance, x, y);
}

float lightDensityKernel(const GaussiansView& light, float x, float y) {
  return lightDensityAt(light, x, y);
}

Densities bothDensitiesKernel(const GaussiansView& reflectance, const GaussiansView& light, float x, float y) {
  return {reflectanceDensityAt(reflectance, x, y), lightDensityAt(light, x, y)};
}

/// The step of a Placement, broadcast to all lanes.
template <class D>
struct Step {
  Step(D d, const Placement& p)
      : x(hn::Set(d, p.stepX)), y(hn::Set(d, p.stepY)), squared(hn::Set(d, p.stepX * p.stepX + p.stepY * p.stepY)) {}
  hn::Vec<D> x, y, squared;
};

// The largest t ≤ 1 with |mean + t · step| ≤ 1 for each mean inside the disc; 1 for means outside.
template <class D>
HWY_INLINE hn::Vec<D> largestStep(D d, hn::Vec<D> x, hn::Vec<D> y, const Step<D>& step) {
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  const auto room = hn::NegMulAdd(y, y, hn::NegMulAdd(x, x, one));
  const auto along = hn::MulAdd(x, step.x, hn::Mul(y, step.y));
  const auto root = hn::Sqrt(hn::Max(hn::MulAdd(step.squared, room, hn::Mul(along, along)), zero));
  const auto t = hn::Min(hn::Max(hn::Div(hn::Sub(root, along), step.squared), zero), one);
  return hn::IfThenElse(hn::And(hn::Gt(room, zero), hn::Gt(step.squared, zero)), t, one);
}

template <class D>
HWY_INLINE void placeBy(D d, GaussiansView mixture, const Placement& p, float* out, int stride, int first) {
  const Step<D> step(d, p);
  const auto cosine = hn::Set(d, p.cosine), sine = hn::Set(d, p.sine);
  const auto factor = hn::Set(d, p.factor), half = hn::Set(d, -kHalfLog2e);
  for (int k = 0; k < mixture.count; k += static_cast<int>(hn::Lanes(d))) {
    const auto from = [&](GaussianField f) { return hn::LoadU(d, mixture.field(f) + k); };
    const auto to = [&](GaussianField f, hn::Vec<D> v) {
      hn::StoreU(v, d, out + static_cast<std::ptrdiff_t>(f) * stride + first + k);
    };
    const auto oldX = hn::Mul(hn::Set(d, p.mirrorX), from(GaussianField::x)),
               oldY = hn::Mul(hn::Set(d, p.mirrorY), from(GaussianField::y));
    const auto t = largestStep(d, oldX, oldY, step);
    const auto x = hn::MulAdd(t, step.x, oldX), y = hn::MulAdd(t, step.y, oldY);
    to(GaussianField::x, hn::NegMulAdd(sine, y, hn::Mul(cosine, x)));
    to(GaussianField::y, hn::MulAdd(cosine, y, hn::Mul(sine, x)));
    // Σ = xx (1, slope)(1, slope)ᵀ + d (0, 1)(0, 1)ᵀ: both vectors are rotated, and |Σ| does not change.
    const auto slope = hn::Mul(hn::Set(d, p.mirrorX * p.mirrorY), from(GaussianField::slope));
    const auto ux = hn::NegMulAdd(sine, slope, cosine), uy = hn::MulAdd(cosine, slope, sine);
    const auto wide = from(GaussianField::xx), narrow = from(GaussianField::conditional);
    const auto xx = hn::MulAdd(hn::Mul(wide, ux), ux, hn::Mul(hn::Mul(narrow, sine), sine));
    const auto xy = hn::NegMulAdd(hn::Mul(narrow, sine), cosine, hn::Mul(hn::Mul(wide, ux), uy));
    const auto yy = hn::MulAdd(hn::Mul(wide, uy), uy, hn::Mul(hn::Mul(narrow, cosine), cosine));
    const auto inverse = hn::Div(hn::Set(d, 1.0f), xx);
    to(GaussianField::xx, xx);
    to(GaussianField::xy, xy);
    to(GaussianField::yy, yy);
    to(GaussianField::slope, hn::Mul(xy, inverse));
    to(GaussianField::along, hn::Mul(half, inverse));
    const auto determinant = hn::Mul(wide, narrow);
    to(GaussianField::conditional, hn::Mul(determinant, inverse));
    to(GaussianField::across, hn::Div(hn::Mul(half, xx), determinant));
    to(GaussianField::scale, hn::Mul(factor, from(GaussianField::scale)));
    to(GaussianField::weight, hn::Mul(factor, from(GaussianField::weight)));
  }
}

void placeMixtureKernel(const GaussiansView& mixture, const Placement& placement, float* out, int stride, int first) {
  // NOLINTNEXTLINE(bugprone-branch-clone): the branches are equal only for targets with four lanes
  if (mixture.count <= kPaddingMultiple)
    placeBy(hn::CappedTag<float, kPaddingMultiple>(), mixture, placement, out, stride, first);
  else
    placeBy(hn::CappedTag<float, kMaxVectorLanes>(), mixture, placement, out, stride, first);
}

}  // namespace lobe::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lobe {

namespace {
HWY_EXPORT(pairMassesKernel);
HWY_EXPORT(choosePairKernel);
HWY_EXPORT(lightDensityKernel);
HWY_EXPORT(bothDensitiesKernel);
HWY_EXPORT(placeMixtureKernel);
}  // namespace

float pairMasses(const GaussiansView& reflectance, float constant, const GaussiansView& light, float* pairs,
                 float* columns) {
  return HWY_DYNAMIC_DISPATCH(pairMassesKernel)(reflectance, constant, light, pairs, columns);
}

PairIndex choosePair(const float* pairs, const float* columns, int rows, int stride, float choice) {
  return HWY_DYNAMIC_DISPATCH(choosePairKernel)(pairs, columns, rows, stride, choice);
}

float lightDensity(const GaussiansView& light, float x, float y) {
  return HWY_DYNAMIC_DISPATCH(lightDensityKernel)(light, x, y);
}

Densities densities(const GaussiansView& reflectance, const GaussiansView& light, float x, float y) {
  return HWY_DYNAMIC_DISPATCH(bothDensitiesKernel)(reflectance, light, x, y);
}

void placeMixture(const GaussiansView& mixture, const Placement& placement, float* out, int stride, int first) {
  HWY_DYNAMIC_DISPATCH(placeMixtureKernel)(mixture, placement, out, stride, first);
}

std::vector<std::int64_t> kernelTargets() {
  return hwy::SupportedAndGeneratedTargets();
}

std::string kernelTargetName(std::int64_t target) {
  return hwy::TargetName(target);
}

void useKernelTarget(std::int64_t target) {
  hwy::SetSupportedTargetsForTest(target);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

}  // namespace lobe
#endif
