#include "runtime/render/all_pairs.h"

// Includes this file once for each instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "runtime/render/all_pairs.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep

#include <hwy/highway.h>

#include "runtime/mixture/lane_math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lobe::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// One component of the reflectance with all of the light's: the moments of each product, by Cholesky factors.
template <class D>
HWY_INLINE hn::Vec<D> formRow(D d, const LanesView& reflectance, int i, const LanesView& light, int first, float* out) {
  const auto one = [&](LaneField f) { return hn::Set(d, reflectance.field(f)[i]); };
  const auto two = [&](LaneField f) { return hn::LoadU(d, light.field(f) + first); };
  const auto to = [&](LaneField f, hn::Vec<D> v) {
    hn::StoreU(v, d,
               out + static_cast<std::ptrdiff_t>(f) * AllPairs::kMostPairs + std::ptrdiff_t{i} * light.stride + first);
  };
  const auto half = hn::Set(d, -kHalfLog2e);
  const auto xx1 = one(LaneField::xx), xx2 = two(LaneField::xx);
  const auto slope1 = one(LaneField::slope), slope2 = two(LaneField::slope);
  const auto d1 = one(LaneField::conditional), d2 = two(LaneField::conditional);
  const auto sxx = hn::Add(xx1, xx2), across = hn::Add(d1, d2), wide = hn::Mul(xx1, xx2);
  const auto bend = hn::Sub(slope1, slope2);
  const auto determinant = hn::MulAdd(sxx, across, hn::Mul(wide, hn::Mul(bend, bend)));
  const auto inverse = hn::Div(hn::Set(d, 1.0f), determinant), inverseAcross = hn::Div(hn::Set(d, 1.0f), across);
  const auto dx = hn::Sub(two(LaneField::x), one(LaneField::x)), dy = hn::Sub(two(LaneField::y), one(LaneField::y));
  const auto gap = hn::NegMulAdd(slope2, dx, dy);  // the light's ridge less the reflectance's mean, at its x
  const auto shift = hn::Mul(inverse, hn::MulAdd(hn::Mul(xx1, across), dx, hn::Mul(hn::Mul(wide, bend), gap)));
  const auto share = hn::Mul(d1, inverseAcross);
  const auto x = hn::Add(one(LaneField::x), shift);
  const auto ridge1 = hn::MulAdd(slope1, shift, one(LaneField::y));
  const auto ridge2 = hn::MulAdd(slope2, hn::Sub(x, two(LaneField::x)), two(LaneField::y));
  const auto xx = hn::Mul(wide, hn::Mul(across, inverse)), dd = hn::Mul(share, d2);
  // The weight is the normal density of the difference of the means under the sum of the covariances.
  const auto sxy = hn::MulAdd(slope1, xx1, hn::Mul(slope2, xx2));
  const auto lean = hn::NegMulAdd(hn::Div(sxy, sxx), dx, dy);
  const auto square = hn::Add(hn::Div(hn::Mul(dx, dx), sxx), hn::Mul(hn::Mul(lean, lean), hn::Mul(sxx, inverse)));
  const auto weight = hn::Mul(hn::Mul(hn::Mul(one(LaneField::weight), two(LaneField::weight)), hn::Set(d, 0.15915494f)),
                              hn::Mul(hn::Sqrt(inverse), exp2Negative(d, hn::Mul(half, square))));
  to(LaneField::x, x);
  to(LaneField::y, hn::MulAdd(share, hn::Sub(ridge2, ridge1), ridge1));
  to(LaneField::slope, hn::Mul(inverseAcross, hn::MulAdd(slope1, d2, hn::Mul(slope2, d1))));
  to(LaneField::along, hn::Div(half, xx));
  to(LaneField::across, hn::Div(half, dd));
  to(LaneField::scale, hn::Mul(weight, hn::Div(hn::Set(d, 0.15915494f), hn::Sqrt(hn::Mul(xx, dd)))));
  to(LaneField::xx, xx);
  to(LaneField::conditional, dd);
  to(LaneField::weight, weight);
  return weight;
}

template <class D>
HWY_INLINE float formBy(D d, const LanesView& reflectance, const LanesView& light, float* out) {
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
    const auto at = [&](LaneField f) {
      return hn::LoadU(d, pairs + static_cast<std::ptrdiff_t>(f) * AllPairs::kMostPairs + k);
    };
    const auto dx = hn::Sub(x, at(LaneField::x));
    const auto dy = hn::NegMulAdd(at(LaneField::slope), dx, hn::Sub(y, at(LaneField::y)));
    const auto exponent =
        hn::MulAdd(hn::Mul(dx, dx), at(LaneField::along), hn::Mul(hn::Mul(dy, dy), at(LaneField::across)));
    total = hn::MulAdd(at(LaneField::scale), exp2Negative(d, exponent), total);
  }
  return hn::GetLane(hn::SumOfLanes(d, total));
}

float formKernel(const LanesView& reflectance, const LanesView& light, int lanes, float* out) {
  if (lanes == kLaneStep) return formBy(hn::CappedTag<float, kLaneStep>(), reflectance, light, out);
  return formBy(hn::CappedTag<float, kMostLanes>(), reflectance, light, out);
}

float sumKernel(const float* pairs, int count, int lanes, float x, float y) {
  if (lanes == kLaneStep) return sumBy(hn::CappedTag<float, kLaneStep>(), pairs, count, x, y);
  return sumBy(hn::CappedTag<float, kMostLanes>(), pairs, count, x, y);
}

}  // namespace lobe::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lobe {

namespace {
HWY_EXPORT(formKernel);
HWY_EXPORT(sumKernel);
}  // namespace

AllPairs::AllPairs(const LanesView& reflectance, const LanesView& light, int lanes)
    : lanes_(lanes),
      mass_(HWY_DYNAMIC_DISPATCH(formKernel)(reflectance, light, lanes, pairs_.data())),
      count_(reflectance.count * light.stride) {}

Vec2 AllPairs::sample(float choice, const Vec2& u) const {
  const LanesView view{pairs_.data(), kMostPairs, count_};
  const float* weights = view.field(LaneField::weight);
  float left = choice * mass_;
  int chosen = 0;
  while (chosen < count_ - 1 && left >= weights[chosen]) left -= weights[chosen++];
  return sampleLane(view, chosen, u);
}

float AllPairs::pdf(const Vec2& y) const {
  return HWY_DYNAMIC_DISPATCH(sumKernel)(pairs_.data(), count_, lanes_, y.x(), y.y()) / mass_;
}

}  // namespace lobe
#endif
