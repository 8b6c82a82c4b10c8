#include "materials/lobes/principled_diffuse.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/core/sampling.h"

namespace lobe {
namespace {

constexpr int kCells = 32;

/// Integrates by the midpoint rule, with equal steps of sin²θ and of azimuth.
PrincipledDiffuse integrate(float cosine) {
  constexpr int kElevations = 64;
  constexpr int kAzimuths = 32;
  const Vec3 wo(std::sqrt(1.0f - cosine * cosine), 0.0f, cosine);
  PrincipledDiffuse sum;
  for (int i = 0; i < kElevations; ++i)
    for (int k = 0; k < kAzimuths; ++k) {
      const float sine2 = (static_cast<float>(i) + 0.5f) / kElevations;
      const float phi = kPi * (static_cast<float>(k) + 0.5f) / kAzimuths;  // the other half is symmetric
      const float sine = std::sqrt(sine2);
      const Vec3 wi(sine * std::cos(phi), sine * std::sin(phi), std::sqrt(1.0f - sine2));
      sum.add(PrincipledDiffuse::between(wo, wi), kPi / (kElevations * kAzimuths));
    }
  return sum;
}

using Table = std::array<PrincipledDiffuse, kCells + 1>;

const Table& table() {
  static const Table rows = [] {
    Table result;
    for (std::size_t i = 0; i <= kCells; ++i)
      result[i] = integrate(std::max(1e-4f, static_cast<float>(i) / static_cast<float>(kCells)));
    return result;
  }();
  return rows;
}

}  // namespace

float schlickWeight(float cosine) {
  const float m = std::clamp(1.0f - cosine, 0.0f, 1.0f);
  return m * m * m * m * m;
}

PrincipledDiffuse PrincipledDiffuse::between(const Vec3& wo, const Vec3& wi) {
  const float o = schlickWeight(wo.z());
  const float i = schlickWeight(wi.z());
  const float cosine2 = std::clamp(0.5f * (1.0f + wo.dot(wi)), 0.0f, 1.0f);  // of half the angle between wo and wi
  // Burley's flattened version of the term of Hanrahan and Krueger; kept finite if both directions are grazing.
  const float shape = 1.25f * (1.0f / std::max(1e-6f, wo.z() + wi.z()) - 0.5f);
  PrincipledDiffuse terms;
  terms.plain = (1.0f - 0.5f * o) * (1.0f - 0.5f * i) * kInvPi;
  terms.retro = 2.0f * cosine2 * (o + i - o * i) * kInvPi;
  terms.retro2 = 4.0f * cosine2 * cosine2 * o * i * kInvPi;
  terms.flat = (shape * (1.0f - o) * (1.0f - i) + 0.625f) * kInvPi;
  terms.flat1 = shape * cosine2 * (o + i - 2.0f * o * i) * kInvPi;
  terms.flat2 = shape * cosine2 * cosine2 * o * i * kInvPi;
  terms.sheen = schlickWeight(std::sqrt(cosine2));
  return terms;
}

PrincipledDiffuse PrincipledDiffuse::albedo(float cosine) {
  const float x = std::clamp(cosine, 0.0f, 1.0f) * kCells;
  const auto cell = static_cast<std::size_t>(std::min(x, kCells - 1.0f));
  const float t = x - static_cast<float>(cell);
  PrincipledDiffuse result;
  return result.add(table()[cell], 1.0f - t).add(table()[cell + 1], t);
}

float PrincipledDiffuse::diffuse(float roughness, float flatness) const {
  const float rough = plain + roughness * (retro + roughness * retro2);
  return std::lerp(rough, flat + roughness * (flat1 + roughness * flat2), flatness);
}

PrincipledDiffuse& PrincipledDiffuse::add(const PrincipledDiffuse& other, float weight) {
  plain += weight * other.plain;
  retro += weight * other.retro;
  retro2 += weight * other.retro2;
  flat += weight * other.flat;
  flat1 += weight * other.flat1;
  flat2 += weight * other.flat2;
  sheen += weight * other.sheen;
  return *this;
}

}  // namespace lobe
