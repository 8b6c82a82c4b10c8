#include "runtime/bench/eager_product.h"

// Includes this file once for each instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "runtime/bench/eager_product.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep

#include <hwy/highway.h>

#include "runtime/mixture/kernel_math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lobe::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// Products of one component of the reflectance with components of the light, which start at `first` and fill a SIMD
// register. The moments of the products are computed from Cholesky factors.
template <class D>
HWY_INLINE hn::Vec<D> formRow(D d, const GaussiansView& reflectance, int i, const GaussiansView& light, int first,
                              float* out) {
  const auto one = [&](GaussianField f) { return hn::Set(d, reflectance.field(f)[i]); };
  const auto two = [&](GaussianField f) { return hn::LoadU(d, light.field(f) + first); };
  const auto to = [&](GaussianField f, hn::Vec<D> v) {
    hn::StoreU(
        v, d,
        out + static_cast<std::ptrdiff_t>(f) * EagerProduct::kMostPairs + std::ptrdiff_t{i} * light.stride + first);
  };
  const auto half = hn::Set(d, -kHalfLog2e);
  const auto xx1 = one(GaussianField::xx), xx2 = two(GaussianField::xx);
  const auto slope1 = one(GaussianField::slope), slope2 = two(GaussianField::slope);
  const auto d1 = one(GaussianField::conditional), d2 = two(GaussianField::conditional);
  const auto sxx = hn::Add(xx1, xx2), across = hn::Add(d1, d2), wide = hn::Mul(xx1, xx2);
  const auto bend = hn::Sub(slope1, slope2);
  const auto determinant = hn::MulAdd(sxx, across, hn::Mul(wide, hn::Mul(bend, bend)));
  const auto inverse = hn::Div(hn::Set(d, 1.0f), determinant), inverseAcross = hn::Div(hn::Set(d, 1.0f), across);
  const auto dx = hn::Sub(two(GaussianField::x), one(GaussianField::x)),
             dy = hn::Sub(two(GaussianField::y), one(GaussianField::y));
  const auto gap = hn::NegMulAdd(slope2, dx, dy);  // the light's ridge minus the reflectance's mean, at its x
  const auto shift = hn::Mul(inverse, hn::MulAdd(hn::Mul(xx1, across), dx, hn::Mul(hn::Mul(wide, bend), gap)));
  const auto fraction = hn::Mul(d1, inverseAcross);
  const auto x = hn::Add(one(GaussianField::x), shift);
  const auto ridge1 = hn::MulAdd(slope1, shift, one(GaussianField::y));
  const auto ridge2 = hn::MulAdd(slope2, hn::Sub(x, two(GaussianField::x)), two(GaussianField::y));
  const auto xx = hn::Mul(wide, hn::Mul(across, inverse)), dd = hn::Mul(fraction, d2);
  // The weight is the Gaussian density of the difference of the means, with the sum of the covariances.
  const auto sxy = hn::MulAdd(slope1, xx1, hn::Mul(slope2, xx2));
  const auto lean = hn::NegMulAdd(hn::Div(sxy, sxx), dx, dy);
  const auto square = hn::Add(hn::Div(hn::Mul(dx, dx), sxx), hn::Mul(hn::Mul(lean, lean), hn::Mul(sxx, inverse)));
  const auto weight =
      hn::Mul(hn::Mul(hn::Mul(one(GaussianField::weight), two(GaussianField::weight)), hn::Set(d, 0.15915494f)),
              hn::Mul(hn::Sqrt(inverse), exp2Negative(d, hn::Mul(half, square))));
  to(GaussianField::x, x);
  to(GaussianField::y, hn::MulAdd(fraction, hn::Sub(ridge2, ridge1), ridge1));
  to(GaussianField::slope, hn::Mul(inverseAcross, hn::MulAdd(slope1, d2, hn::Mul(slope2, d1))));
  to(GaussianField::along, hn::Div(half, xx));
  to(GaussianField::across, hn::Div(half, dd));
  to(GaussianField::scale, hn::Mul(weight, hn::Div(hn::Set(d, 0.15915494f), hn::Sqrt(hn::Mul(xx, dd)))));
  to(GaussianField::xx, xx);
  to(GaussianField::conditional, dd);
  to(GaussianField::weight, weight);
  return weight;
}

template <class D>
HWY_INLINE float formBy(D d, const GaussiansView& reflectance, const GaussiansView& light, float* out) {
  auto total = hn::Zero(d);
  for (int i = 0; i < reflectance.count; ++i)
    for (int j = 0; j < light.stride; j += static_cast<int>(hn::Lanes(d)))
      total = hn::Add(total, formRow(d, reflectance, i, light, j, out));
  return hn::GetLane(hn::SumOfLanes(d, total));
}

template <class D>
HWY_INLINE float sumBy(D d, const float* pairs, int count, float px, float py) {
  const auto x = hn::Set(d, px), y = hn::Set(d, py);
  auto total = hn::Zero(d);
  for (int k = 0; k < count; k += static_cast<int>(hn::Lanes(d))) {
    const auto at = [&](GaussianField f) {
      return hn::LoadU(d, pairs + static_cast<std::ptrdiff_t>(f) * EagerProduct::kMostPairs + k);
    };
    const auto dx = hn::Sub(x, at(GaussianField::x));
    const auto dy = hn::NegMulAdd(at(GaussianField::slope), dx, hn::Sub(y, at(GaussianField::y)));
    const auto exponent =
        hn::MulAdd(hn::Mul(dx, dx), at(GaussianField::along), hn::Mul(hn::Mul(dy, dy), at(GaussianField::across)));
    total = hn::MulAdd(at(GaussianField::scale), exp2Negative(d, exponent), total);
  }
  return hn::GetLane(hn::SumOfLanes(d, total));
}

float formKernel(const GaussiansView& reflectance, const GaussiansView& light, int lanes, float* out) {
  if (lanes == kPaddingMultiple) return formBy(hn::CappedTag<float, kPaddingMultiple>(), reflectance, light, out);
  return formBy(hn::CappedTag<float, kMaxVectorLanes>(), reflectance, light, out);
}

float sumKernel(const float* pairs, int count, int lanes, float x, float y) {
  if (lanes == kPaddingMultiple) return sumBy(hn::CappedTag<float, kPaddingMultiple>(), pairs, count, x, y);
  return sumBy(hn::CappedTag<float, kMaxVectorLanes>(), pairs, count, x, y);
}

}  // namespace lobe::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lobe {

namespace {
HWY_EXPORT(formKernel);
HWY_EXPORT(sumKernel);
}  // namespace

EagerProduct::EagerProduct(const GaussiansView& reflectance, const GaussiansView& light, int lanes)
    : lanes_(lanes), count_(reflectance.count * light.stride) {
  mass_ = HWY_DYNAMIC_DISPATCH(formKernel)(reflectance, light, lanes, pairs_.data());
}

Vec2 EagerProduct::sample(float choice, const Vec2& u) const {
  const GaussiansView view{pairs_.data(), kMostPairs, count_};
  const float* weights = view.field(GaussianField::weight);
  float left = choice * mass_;
  int chosen = 0;
  while (chosen < count_ - 1 && left >= weights[chosen]) left -= weights[chosen++];
  return sampleLane(view, chosen, u);
}

float EagerProduct::pdf(const Vec2& y) const {
  return HWY_DYNAMIC_DISPATCH(sumKernel)(pairs_.data(), count_, lanes_, y.x(), y.y()) / mass_;
}

}  // namespace lobe
#endif
