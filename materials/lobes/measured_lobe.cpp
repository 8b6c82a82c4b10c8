#include "materials/lobes/measured_lobe.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "runtime/core/sampling.h"

namespace lobe {
namespace {

constexpr double kPiD = std::numbers::pi;

/// Fraction of cosine-weighted samples. They keep the density positive where a table is zero but the measurement is
/// not.
constexpr double kCosineFraction = 0.1;

std::optional<Directions> directionsOf(const Vec3& wo, const Vec3& wi) {
  if (!(wo.z() > 0.0f && wi.z() > 0.0f)) return std::nullopt;
  Directions d{wo.cast<double>().normalized(), wi.cast<double>().normalized(), {}};
  d.half = (d.wo + d.wi).normalized();
  return d;
}

}  // namespace

Spherical spherical(const Eigen::Vector3d& w) {
  return {std::atan2(std::hypot(w.x(), w.y()), w.z()), std::atan2(w.y(), w.x())};
}

Eigen::Vector3d squareToHalfVector(const Eigen::Vector2d& point, double azimuth) {
  const double theta = point.x() * point.x() * (0.5 * kPiD);
  const double phi = (2.0 * point.y() - 1.0) * kPiD + azimuth;
  return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
}

Eigen::Vector2d halfVectorToSquare(const Eigen::Vector3d& half, double azimuth) {
  const Spherical at = spherical(half);
  const double turns = (at.phi - azimuth) / (2.0 * kPiD) + 0.5;
  return {std::sqrt(at.theta * (2.0 / kPiD)), turns - std::floor(turns)};
}

double halfVectorJacobian(const Eigen::Vector3d& half) {
  constexpr double kLeast = 1e-12;
  const double sine = std::hypot(half.x(), half.y());
  const double x = std::sqrt(std::atan2(sine, half.z()) * (2.0 / kPiD));
  return std::max(2.0 * kPiD * kPiD * x * sine, kLeast);
}

Rgb MeasuredLobe::value(const Vec3& wo, const Vec3& wi) const {
  const std::optional<Directions> directions = directionsOf(wo, wi);
  return directions ? measured(*directions) : Rgb::Zero();
}

std::string MeasuredLobe::key() const {
  return fmt::format("{} xxh3={:016x}", model(), contentHash_);
}

std::optional<LobeSample> MeasuredLobe::sample(const Vec3& wo, const Vec2& u) const {
  if (!(wo.z() > 0.0f)) return std::nullopt;
  Vec3 wi;
  if (u.x() < kCosineFraction) {
    wi = squareToCosineHemisphere({u.x() / static_cast<float>(kCosineFraction), u.y()});
  } else {
    const Eigen::Vector3d o = wo.cast<double>().normalized();
    const Eigen::Vector3d half = sampleHalfVector(o, {(u.x() - kCosineFraction) / (1.0 - kCosineFraction), u.y()});
    wi = (2.0 * o.dot(half) * half - o).normalized().cast<float>();
  }
  const float density = pdf(wo, wi);
  if (!(density > 0.0f)) return std::nullopt;
  return LobeSample{wi, density};
}

float MeasuredLobe::pdf(const Vec3& wo, const Vec3& wi) const {
  const std::optional<Directions> d = directionsOf(wo, wi);
  if (!d) return 0.0f;
  const double byHalfVector = halfVectorDensity(d->wo, d->half) / (4.0 * d->wo.dot(d->half));
  return static_cast<float>(kCosineFraction * d->wi.z() / kPiD + (1.0 - kCosineFraction) * byHalfVector);
}

namespace {

/// Directional albedo averaged over azimuths, tabulated over cosθ.
class AlbedoTable {
 public:
  explicit AlbedoTable(const MeasuredLobe& lobe) {
    for (std::size_t i = 0; i < kNodes; ++i) {
      const float cosine = std::max(static_cast<float>(i) / (kNodes - 1), 1e-3f);
      nodes_[i] = estimate(lobe, cosine);
    }
  }
  Rgb operator()(float cosine) const {
    const float place = std::clamp(cosine, 0.0f, 1.0f) * (kNodes - 1);
    const std::size_t node = std::min(static_cast<std::size_t>(place), kNodes - 2);
    const float rest = place - static_cast<float>(node);
    return nodes_[node] * (1.0f - rest) + nodes_[node + 1] * rest;
  }

 private:
  static constexpr std::size_t kNodes = 17;

  static Rgb estimate(const MeasuredLobe& lobe, float cosine) {
    constexpr int kSamples = 512;
    // Increments of Roberts' low-discrepancy sequence R3.
    constexpr std::array<double, 3> kStep = {0.8191725133961645, 0.6710436067037893, 0.5497004779019703};
    const float sine = std::sqrt(1.0f - cosine * cosine);
    Rgb sum = Rgb::Zero();
    for (int i = 0; i < kSamples; ++i) {
      std::array<float, 3> u;
      for (std::size_t axis = 0; axis < 3; ++axis)
        u[axis] = std::min(static_cast<float>(std::fmod(0.5 + kStep[axis] * i, 1.0)), kOneMinusEpsilon);
      const float phi = 2.0f * kPi * u[2];
      const Vec3 wo(sine * std::cos(phi), sine * std::sin(phi), cosine);
      const std::optional<LobeSample> drawn = lobe.sample(wo, {u[0], u[1]});
      if (drawn) sum += lobe.value(wo, drawn->wi) * (drawn->wi.z() / drawn->pdf);
    }
    return (sum / kSamples).min(1.0f);
  }

  std::array<Rgb, kNodes> nodes_;
};

class MeasuredBsdf final : public Bsdf {
 public:
  explicit MeasuredBsdf(std::shared_ptr<const MeasuredLobe> lobe)
      : lobe_(std::move(lobe)), lobes_{lobe_}, albedo_(*lobe_) {}

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2&) const override { return lobe_->value(wo, wi); }

  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2&, float, const Vec2& u) const override {
    const std::optional<LobeSample> drawn = lobe_->sample(wo, u);
    if (!drawn) return std::nullopt;
    return BsdfSample{drawn->wi, lobe_->value(wo, drawn->wi), drawn->pdf};
  }

  float pdf(const Vec3& wo, const Vec3& wi, const Vec2&) const override { return lobe_->pdf(wo, wi); }

  std::span<const LobePtr> lobes() const override { return lobes_; }

  LobeMixture mixture(const Vec3& wo, const Vec2&) const override {
    LobeMixture result;
    if (!(wo.z() > 0.0f)) return result;
    result.glossy[0] = {0, 1.0f};
    result.glossyCount = 1;
    return result;
  }

  Rgb albedo(const Vec3& wo, const Vec2&) const override { return wo.z() > 0.0f ? albedo_(wo.z()) : Rgb::Zero(); }

 private:
  std::shared_ptr<const MeasuredLobe> lobe_;
  std::array<LobePtr, 1> lobes_;
  AlbedoTable albedo_;
};

}  // namespace

BsdfPtr makeMeasuredBsdf(std::shared_ptr<const MeasuredLobe> lobe) {
  return std::make_shared<MeasuredBsdf>(std::move(lobe));
}

BsdfPtr makeMeasuredFrom(const Parameters& parameters,
                         std::shared_ptr<const MeasuredLobe> (*read)(const std::filesystem::path& path)) {
  const std::string filename = parameters.text("filename", "");
  if (filename.empty()) throw ParameterError("filename", "the parameter \"filename\" is needed");
  try {
    return makeMeasuredBsdf(read(filename));
  } catch (const std::runtime_error& error) {
    throw ParameterError("filename", error.what());
  }
}

}  // namespace lobe
