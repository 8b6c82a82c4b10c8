// Materials of the MERL database (Matusik, Pfister, Brand and McMillan 2003, "A Data-Driven Reflectance Model"):
// isotropic BRDFs over Rusinkiewicz' half and difference angles.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numbers>
#include <stdexcept>

#include <fmt/format.h>

#include "materials/lobes/bilinear_warp.h"
#include "materials/lobes/measured_lobe.h"
#include "runtime/core/files.h"

namespace lobe {
namespace {

constexpr double kPiD = std::numbers::pi;

// Numbers of bins: of the polar angle of the half vector, which are narrow near 0 (the index is proportional to the
// square root of the angle), of the polar angle of the difference vector, and of its azimuth. The azimuth covers half a
// circle, because the BRDF is reciprocal.
constexpr std::size_t kThetaHalf = 90;
constexpr std::size_t kThetaDifference = 90;
constexpr std::size_t kPhiDifference = 180;
constexpr std::size_t kBins = kThetaHalf * kThetaDifference * kPhiDifference;

constexpr std::array<double, 3> kScales = {1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0};

/// A position between the centres of two bins.
struct Between {
  std::size_t first, second;
  float rest;
};

/// place is in units of bins.
Between clampedBetween(double place, std::size_t bins) {
  const double inside = std::clamp(place - 0.5, 0.0, static_cast<double>(bins - 1));
  const std::size_t first = std::min(static_cast<std::size_t>(inside), bins - 2);
  return {first, first + 1, static_cast<float>(inside - static_cast<double>(first))};
}

Between cyclicBetween(double place, std::size_t bins) {
  const auto count = static_cast<double>(bins);
  double inside = place - 0.5;
  inside -= count * std::floor(inside / count);
  const std::size_t first = std::min(static_cast<std::size_t>(inside), bins - 1);
  return {first, (first + 1) % bins, static_cast<float>(inside - static_cast<double>(first))};
}

/// The BRDF, interpolated linearly between the centres of the bins.
class MerlTable {
 public:
  explicit MerlTable(std::vector<Eigen::Array3f> values) : values_(std::move(values)) {}

  Rgb at(const Directions& d) const {
    const Eigen::Vector3d difference = d.wi - d.wo;
    const double sine = std::hypot(d.half.x(), d.half.y());
    const double thetaHalf = std::atan2(sine, d.half.z());
    const double thetaDifference = std::atan2(difference.norm(), (d.wi + d.wo).norm());
    // The azimuth of the difference vector about the half vector, relative to the plane that contains the normal.
    const double cosPhi = sine > 0.0 ? d.half.x() / sine : 1.0;
    const double sinPhi = sine > 0.0 ? d.half.y() / sine : 0.0;
    const Eigen::Vector3d x(cosPhi * d.half.z(), sinPhi * d.half.z(), -sine);
    const Eigen::Vector3d y(-sinPhi, cosPhi, 0.0);
    const double phiDifference = std::atan2(difference.dot(y), difference.dot(x));
    return interpolate(clampedBetween(std::sqrt(thetaHalf / (0.5 * kPiD)) * kThetaHalf, kThetaHalf),
                       clampedBetween(thetaDifference / (0.5 * kPiD) * kThetaDifference, kThetaDifference),
                       cyclicBetween(phiDifference / kPiD * kPhiDifference, kPhiDifference));
  }

 private:
  Rgb interpolate(const Between& half, const Between& theta, const Between& phi) const {
    const auto along = [&](std::size_t h, std::size_t t) -> Rgb {
      const Eigen::Array3f* const row = values_.data() + (h * kThetaDifference + t) * kPhiDifference;
      return row[phi.first] * (1.0f - phi.rest) + row[phi.second] * phi.rest;
    };
    const auto over = [&](std::size_t h) -> Rgb {
      return along(h, theta.first) * (1.0f - theta.rest) + along(h, theta.second) * theta.rest;
    };
    return over(half.first) * (1.0f - half.rest) + over(half.second) * half.rest;
  }

  std::vector<Eigen::Array3f> values_;
};

/// Samples half vectors so that the density of wi is proportional to f · cosθ, from tables for several elevations of
/// wo.
class MerlSampler {
 public:
  explicit MerlSampler(const MerlTable& table) : nodes_({0.0f}, elevations()), warp_(kSize, tabulate(table)) {}

  Eigen::Vector3d sample(const Eigen::Vector3d& wo, const Eigen::Vector2d& u) const {
    const Spherical at = spherical(wo);
    return squareToHalfVector(warp_.sample(u, nodes_.at(0.0, at.theta)).point, at.phi);
  }

  double density(const Eigen::Vector3d& wo, const Eigen::Vector3d& half) const {
    const Spherical at = spherical(wo);
    return warp_.density(halfVectorToSquare(half, at.phi), nodes_.at(0.0, at.theta)) / halfVectorJacobian(half);
  }

 private:
  static constexpr std::size_t kElevations = 19;
  static constexpr TableSize kSize = {kThetaHalf + 1, 65};

  static std::vector<float> elevations() {
    std::vector<float> result(kElevations);
    for (std::size_t i = 0; i < kElevations; ++i)
      result[i] = static_cast<float>(std::min(0.5 * kPiD * static_cast<double>(i) / (kElevations - 1), 1.57));
    return result;
  }

  std::vector<float> tabulate(const MerlTable& table) const {
    std::vector<float> result;
    result.reserve(kElevations * kSize.nodes());
    for (const float theta : nodes_.second())
      for (std::size_t y = 0; y < kSize.height; ++y)
        for (std::size_t x = 0; x < kSize.width; ++x)
          result.push_back(node(table, theta,
                                {static_cast<double>(x) / static_cast<double>(kSize.width - 1),
                                 static_cast<double>(y) / static_cast<double>(kSize.height - 1)}));
    return result;
  }

  static float node(const MerlTable& table, double theta, const Eigen::Vector2d& point) {
    Directions d{{std::sin(theta), 0.0, std::cos(theta)}, {}, squareToHalfVector(point, 0.0)};
    const double cosHalf = d.wo.dot(d.half);
    d.wi = 2.0 * cosHalf * d.half - d.wo;
    if (!(cosHalf > 0.0 && d.wi.z() > 0.0)) return 0.0f;
    return static_cast<float>(luminance(table.at(d)) * d.wi.z() * 4.0 * cosHalf * halfVectorJacobian(d.half));
  }

  ParameterNodes nodes_;
  BilinearWarp warp_;
};

class MerlLobe final : public MeasuredLobe {
 public:
  MerlLobe(std::string name, std::uint64_t contentHash, MerlTable table)
      : MeasuredLobe(std::move(name), contentHash), table_(std::move(table)), sampler_(table_) {}

  LobeKind kind() const override { return LobeKind::isotropic; }
  std::string model() const override { return "merl"; }

 private:
  Rgb measured(const Directions& directions) const override { return table_.at(directions); }
  Eigen::Vector3d sampleHalfVector(const Eigen::Vector3d& wo, const Eigen::Vector2d& u) const override {
    return sampler_.sample(wo, u);
  }
  double halfVectorDensity(const Eigen::Vector3d& wo, const Eigen::Vector3d& half) const override {
    return sampler_.density(wo, half);
  }

  MerlTable table_;
  MerlSampler sampler_;
};

/// Converts the values of a file. Negative ones, which mean "not measured", become 0. Throws std::runtime_error if a
/// number is not finite or so large that products would not be.
std::vector<Eigen::Array3f> tableFrom(const std::string& path, const char* planes) {
  constexpr float kLargest = 1e30f;
  std::vector<Eigen::Array3f> values(kBins);
  for (std::size_t channel = 0; channel < 3; ++channel)
    for (std::size_t i = 0; i < kBins; ++i) {
      double value;
      std::memcpy(&value, planes + (channel * kBins + i) * sizeof(double), sizeof(double));
      const auto scaled = static_cast<float>(std::max(value, 0.0) * kScales[channel]);
      if (!std::isfinite(value) || !(scaled <= kLargest))
        throw std::runtime_error(fmt::format("{}: contains numbers that are not finite or over {:g}", path, kLargest));
      values[i][static_cast<Eigen::Index>(channel)] = scaled;
    }
  return values;
}

std::shared_ptr<const MeasuredLobe> readMerl(const std::filesystem::path& path) {
  const std::string bytes = nameErrors(path, [&] { return readFile(path); });
  std::array<std::int32_t, 3> extents{};
  if (bytes.size() < sizeof(extents))
    throw std::runtime_error(fmt::format("{}: not a MERL file: it has only {} bytes", path.string(), bytes.size()));
  std::memcpy(extents.data(), bytes.data(), sizeof(extents));
  if (extents[0] != kThetaHalf || extents[1] != kThetaDifference || extents[2] != kPhiDifference)
    throw std::runtime_error(fmt::format("{}: not a MERL file: its extents are {}×{}×{}, but {}×{}×{} are needed",
                                         path.string(), extents[0], extents[1], extents[2], kThetaHalf,
                                         kThetaDifference, kPhiDifference));
  const std::size_t needed = sizeof(extents) + 3 * kBins * sizeof(double);
  if (bytes.size() != needed)
    throw std::runtime_error(
        fmt::format("{}: a MERL file has {} bytes, but this one has {}", path.string(), needed, bytes.size()));
  return std::make_shared<MerlLobe>(path.stem().string(), contentHash(bytes),
                                    MerlTable(tableFrom(path.string(), bytes.data() + sizeof(extents))));
}

}  // namespace

BsdfPtr makeMerl(const Parameters& parameters) {
  return makeMeasuredFrom(parameters, readMerl);
}

}  // namespace lobe
