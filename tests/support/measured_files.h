#pragma once
// Creates files of measured materials for tests.

#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "runtime/core/vec.h"

namespace lobe {

template <typename T>
std::string bytesOf(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}
template <typename T>
std::string bytesOf(T value) {
  return bytesOf(std::vector<T>{value});
}

struct TestField {
  std::string name;
  std::uint8_t type;  ///< 1: bytes, 10: floats
  std::vector<std::uint64_t> shape;
  std::string data;
};

inline TestField floatField(const std::string& name, std::vector<std::uint64_t> shape,
                            const std::vector<float>& values) {
  return {name, 10, std::move(shape), bytesOf(values)};
}

/// The bytes of a tensor file.
inline std::string tensorFile(const std::vector<TestField>& fields) {
  std::size_t offset = 18;
  for (const TestField& field : fields) offset += 13 + field.name.size() + 8 * field.shape.size();
  std::string head("tensor_file\0\1\0", 14);
  head += bytesOf(static_cast<std::uint32_t>(fields.size()));
  std::string data;
  for (const TestField& field : fields) {
    head += bytesOf(static_cast<std::uint16_t>(field.name.size())) + field.name;
    head += bytesOf(static_cast<std::uint16_t>(field.shape.size())) + static_cast<char>(field.type);
    head += bytesOf(static_cast<std::uint64_t>(offset + data.size())) + bytesOf(field.shape);
    data += field.data;
  }
  return head + data;
}

/// ρ without the cosine.
using Brdf = std::function<Rgb(const Eigen::Vector3d& wo, const Eigen::Vector3d& wi)>;

inline Eigen::Vector3d fromAngles(double theta, double phi) {
  return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
}

/// The fields of a measured material whose visible normals are uniform over their square, so that the tables of colours
/// are over half vectors. phi: one azimuth for an isotropic material, or several.
inline std::vector<TestField> measuredFields(const Brdf& brdf, const std::vector<float>& phi, std::uint64_t size) {
  constexpr double kPiD = std::numbers::pi;
  std::vector<float> theta;
  for (int i = 0; i <= 18; ++i) theta.push_back(static_cast<float>(kPiD / 36.0 * i));
  const double azimuthScale = phi.size() > 2 ? 1.0 : 0.0;
  std::vector<float> rgb, luminances;
  for (const float p : phi)
    for (const float t : theta) {
      std::vector<Rgb> values;
      for (std::uint64_t y = 0; y < size; ++y)
        for (std::uint64_t x = 0; x < size; ++x) {
          const double u = static_cast<double>(x) / static_cast<double>(size - 1);
          const double v = static_cast<double>(y) / static_cast<double>(size - 1);
          const Eigen::Vector3d wo = fromAngles(t, azimuthScale * p);
          const Eigen::Vector3d half = fromAngles(0.5 * kPiD * u * u, (2.0 * v - 1.0) * kPiD);
          const Eigen::Vector3d wi = 2.0 * wo.dot(half) * half - wo;
          // Evaluated below the horizon, too, because interpolation crosses it.
          values.push_back(wo.dot(half) > 0.0 ? Rgb(brdf(wo, wi) * static_cast<float>(std::abs(wi.z()))) : Rgb::Zero());
          // The density to be sampled is this value times the Jacobian of half vectors.
          luminances.push_back(luminance(values.back()) * static_cast<float>(u * std::sin(0.5 * kPiD * u * u)) + 1e-6f);
        }
      for (Eigen::Index channel = 0; channel < 3; ++channel)
        for (const Rgb& value : values) rgb.push_back(value[channel]);
    }
  const std::uint64_t phis = phi.size(), thetas = theta.size();
  return {floatField("phi_i", {phis}, phi),
          floatField("theta_i", {thetas}, theta),
          floatField("sigma", {2, 2}, {1, 1, 1, 1}),
          floatField("ndf", {2, 2}, {4, 4, 4, 4}),
          floatField("vndf", {phis, thetas, 2, 2}, std::vector<float>(4 * phis * thetas, 1.0f)),
          floatField("luminance", {phis, thetas, size, size}, luminances),
          floatField("rgb", {phis, thetas, 3, size, size}, rgb),
          {"jacobian", 1, {1}, std::string(1, '\1')},
          {"description", 1, {4}, "test"}};
}

/// The bytes of a MERL file with the values of the BRDF at the centres of its bins.
inline std::string merlFile(const Brdf& brdf) {
  constexpr double kPiD = std::numbers::pi;
  constexpr std::size_t kBinsPerHalf = std::size_t{90} * 180, kBins = 90 * kBinsPerHalf;
  const double scales[] = {1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0};
  std::vector<double> planes(3 * kBins);
  for (std::size_t bin = 0; bin < kBins; ++bin) {
    const std::size_t binOfHalf = bin / kBinsPerHalf;
    const double root = (static_cast<double>(binOfHalf) + 0.5) / 90.0;
    const double half = 0.5 * kPiD * root * root;
    const Eigen::Vector3d d = fromAngles((static_cast<double>(bin / 180 % 90) + 0.5) * kPiD / 180.0,
                                         (static_cast<double>(bin % 180) + 0.5) * kPiD / 180.0);
    // From the frame of the half vector to that of the surface.
    const auto turned = [&](const Eigen::Vector3d& w) {
      return Eigen::Vector3d(std::cos(half) * w.x() + std::sin(half) * w.z(), w.y(),
                             std::cos(half) * w.z() - std::sin(half) * w.x());
    };
    const Rgb value = brdf(turned({-d.x(), -d.y(), d.z()}), turned(d));
    for (std::size_t channel = 0; channel < 3; ++channel)
      planes[channel * kBins + bin] = value[static_cast<Eigen::Index>(channel)] / scales[channel];
  }
  return bytesOf(std::vector<std::int32_t>{90, 90, 180}) + bytesOf(planes);
}

}  // namespace lobe
