// Rough diffuse surfaces: Oren and Nayar's model of Lambertian facets ("Generalization of Lambert's Reflectance Model",
// 1994), either in full (equations 27 to 30, with interreflection) or simplified as in the paper, without the third
// term and interreflection.

#include <algorithm>
#include <array>
#include <cmath>

#include "materials/models.h"
#include "materials/reflectance.h"
#include "runtime/core/sampling.h"

namespace lobe {
namespace {

constexpr float kHalfPi = 0.5f * kPi;

float cube(float x) {
  return x * x * x;
}

/// α and β: the larger and the smaller angle to the normal.
struct Angles {
  float alpha, beta;
};

/// The coefficients of the model, which depend only on roughness. A roughness of 0 gives Lambert's law.
struct Coefficients {
  float constant;
  float towards;  ///< of cos Δφ: light from the side of the viewer
  float oblique;  ///< of 1 − |cos Δφ|
  float interreflected;
};

/// Mitsuba's α, like Beckmann's, is √2 times the standard deviation of slope angles.
Coefficients coefficientsOf(float alpha, bool fast) {
  const float s = 0.5f * alpha * alpha;
  return {1.0f - 0.5f * s / (s + 0.33f), 0.45f * s / (s + 0.09f), fast ? 0.0f : 0.125f * s / (s + 0.09f),
          fast ? 0.0f : 0.17f * s / (s + 0.13f)};
}

float halfAngleTangent(const Angles& a) {
  return std::tan(std::min(0.5f * (a.alpha + a.beta), 0.9999f * kHalfPi));
}
float obliqueTerm(const Angles& a) {
  const float x = 4.0f * a.alpha * a.beta / (kPi * kPi);
  return x * x * halfAngleTangent(a);
}
float tangent(const Angles& a) {
  return std::tan(std::min(a.beta, 0.9999f * kHalfPi));
}

/// Integrals over wi, including the cosine and 1/π, of the terms that the coefficients multiply, tabulated over the
/// angle of wo.
class AlbedoTable {
 public:
  AlbedoTable() {
    for (int i = 0; i <= kCells; ++i)
      rows_[static_cast<std::size_t>(i)] = integrate(kHalfPi * static_cast<float>(i) / kCells);
  }

  struct Row {
    float fastTowards = 0.0f;
    float towards = 0.0f;
    float oblique = 0.0f;
  };

  Row at(float theta) const {
    const float x = std::clamp(theta / kHalfPi, 0.0f, 1.0f) * kCells;
    const int cell = std::min(static_cast<int>(x), kCells - 1);
    const float t = x - static_cast<float>(cell);
    const Row& a = rows_[static_cast<std::size_t>(cell)];
    const Row& b = rows_[static_cast<std::size_t>(cell) + 1];
    return {std::lerp(a.fastTowards, b.fastTowards, t), std::lerp(a.towards, b.towards, t),
            std::lerp(a.oblique, b.oblique, t)};
  }

 private:
  static constexpr int kCells = 64;

  // The integrals over azimuth are analytic: ±2 for cos Δφ over half a circle, 2π − 4 for 1 − |cos Δφ| over the circle.
  static Row integrate(float theta) {
    constexpr int kSteps = 256;
    Row row;
    for (int i = 0; i < kSteps; ++i) {
      const float t = kHalfPi * (static_cast<float>(i) + 0.5f) / kSteps;
      const Angles a{std::max(t, theta), std::min(t, theta)};
      const float weight = std::sin(t) * std::cos(t) * kHalfPi / kSteps * kInvPi;
      row.fastTowards += weight * 2.0f * std::sin(a.alpha) * tangent(a);
      row.towards += weight * 2.0f * cube(a.beta / kHalfPi) * tangent(a);
      row.oblique += weight * (2.0f * kPi - 4.0f) * obliqueTerm(a);
    }
    return row;
  }

  std::array<Row, kCells + 1> rows_;
};

const AlbedoTable& albedoTable() {
  static const AlbedoTable table;
  return table;
}

float angleOf(const Vec3& w) {
  return std::acos(std::clamp(w.z(), 0.0f, 1.0f));
}

/// Cosine of the difference of azimuths; 1 if a direction is the normal.
float azimuthCosine(const Vec3& wo, const Vec3& wi) {
  const float lengths = wo.head<2>().norm() * wi.head<2>().norm();
  return lengths > 0.0f ? std::clamp(wo.head<2>().dot(wi.head<2>()) / lengths, -1.0f, 1.0f) : 1.0f;
}

class RoughDiffuse final : public Bsdf {
 public:
  RoughDiffuse(TexturePtr reflectance, TexturePtr alpha, bool fast)
      : reflectance_(std::move(reflectance)), alpha_(std::move(alpha)), fast_(fast) {}

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    if (!(wo.z() > 0.0f && wi.z() > 0.0f)) return Rgb::Zero();
    const Coefficients c = coefficients(uv);
    const Angles a{std::max(angleOf(wo), angleOf(wi)), std::min(angleOf(wo), angleOf(wi))};
    const float cosPhi = azimuthCosine(wo, wi);
    const Rgb rho = reflectance_->eval(uv);
    if (fast_) return rho * kInvPi * (c.constant + c.towards * std::max(0.0f, cosPhi) * std::sin(a.alpha) * tangent(a));
    const float away = cosPhi > 0.0f ? 0.0f : cube(a.beta / kHalfPi);
    const float once = c.constant + c.towards * cosPhi * (std::sin(a.alpha) - away) * tangent(a) +
                       c.oblique * (1.0f - std::abs(cosPhi)) * obliqueTerm(a);
    const float twice = c.interreflected * (1.0f - cosPhi * (a.beta / kHalfPi) * (a.beta / kHalfPi));
    // The model is negative for rough surfaces seen against the light at grazing angles.
    return (rho * kInvPi * (once + rho * twice)).max(0.0f);
  }

  // Mixes cosine-weighted and uniform sampling: at grazing angles retroreflection makes the value of the model
  // unbounded, but not its product with the cosine.
  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const override {
    Vec3 wi = squareToCosineHemisphere(u);
    if (choice < uniformFraction(uv)) {
      wi = squareToSphere(u);
      wi.z() = std::abs(wi.z());
    }
    const float density = pdf(wo, wi, uv);
    if (!(density > 0.0f)) return std::nullopt;
    return BsdfSample{wi, eval(wo, wi, uv), density};
  }

  float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    if (!(wo.z() > 0.0f && wi.z() > 0.0f)) return 0.0f;
    return std::lerp(cosineHemispherePdf(wi), 0.5f * kInvPi, uniformFraction(uv));
  }

  /// Approximates the model by a constant with the same albedo.
  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const override {
    LobeMixture result;
    result.constant = luminance(albedo(wo, uv));
    return result;
  }

  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    if (!(wo.z() > 0.0f)) return Rgb::Zero();
    const Coefficients c = coefficients(uv);
    const AlbedoTable::Row row = albedoTable().at(angleOf(wo));
    const float once = c.constant + c.towards * (fast_ ? row.fastTowards : row.towards) + c.oblique * row.oblique;
    const Rgb rho = reflectance_->eval(uv);
    return rho * (once + rho * c.interreflected);
  }

 private:
  Coefficients coefficients(const Vec2& uv) const {
    return coefficientsOf(std::max(0.0f, alpha_->evalNumber(uv)), fast_);
  }

  float uniformFraction(const Vec2& uv) const {
    const Coefficients c = coefficients(uv);
    return c.towards / (c.constant + c.towards);
  }

  TexturePtr reflectance_;
  TexturePtr alpha_;
  bool fast_;
};

}  // namespace

BsdfPtr makeRoughDiffuse(const Parameters& parameters) {
  const char* name = parameters.has("diffuse_reflectance") ? "diffuse_reflectance" : "reflectance";
  return std::make_shared<RoughDiffuse>(readReflectance(parameters, {name, grey(0.5f)}),
                                        parameters.texture("alpha", grey(0.2f)),
                                        parameters.flag("use_fast_approx", false));
}

}  // namespace lobe
