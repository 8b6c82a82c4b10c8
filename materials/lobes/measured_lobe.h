#pragma once
// Internal to materials/: the base of the measured models. A measured material is one lobe, whose colours are part of
// the data and whose sampler draws half vectors from tables.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "materials/lobe.h"
#include "materials/models.h"

namespace lobe {

// Parameterisation of half vectors by the unit square (Dupuy and Jakob 2018): x is √(2θ/π), y is φ/2π + 1/2.

struct Spherical {
  double theta;  ///< angle to the z axis
  double phi;    ///< in [−π, π]
};
Spherical spherical(const Eigen::Vector3d& w);

/// The half vector of a point of the square; its azimuth is relative to the given one.
Eigen::Vector3d squareToHalfVector(const Eigen::Vector2d& point, double azimuth);
Eigen::Vector2d halfVectorToSquare(const Eigen::Vector3d& half, double azimuth);
/// Jacobian of squareToHalfVector, solid angle over area: 2π² x sinθ, bounded from below at the pole.
double halfVectorJacobian(const Eigen::Vector3d& half);

/// Unit vectors in double precision; wo and wi are above the surface.
struct Directions {
  Eigen::Vector3d wo, wi, half;
};

class MeasuredLobe : public Lobe {
 public:
  /// contentHash: hash of the file.
  MeasuredLobe(std::string name, std::uint64_t contentHash) : name_(std::move(name)), contentHash_(contentHash) {}

  /// ρ(wo, wi) without the cosine, in colour; finite and not negative, 0 if either direction is not above the surface.
  Rgb value(const Vec3& wo, const Vec3& wi) const;

  std::string key() const final;
  std::string summary() const final { return name_; }
  int revision() const final { return 1; }
  double eval(const Vec3& wo, const Vec3& wi) const final { return luminance(value(wo, wi)); }
  std::optional<LobeSample> sample(const Vec3& wo, const Vec2& u) const final;
  float pdf(const Vec3& wo, const Vec3& wi) const final;

 protected:
  virtual Rgb measured(const Directions& directions) const = 0;
  /// wo is unit and above the surface; u is uniform in [0,1)².
  virtual Eigen::Vector3d sampleHalfVector(const Eigen::Vector3d& wo, const Eigen::Vector2d& u) const = 0;
  /// Density of sampleHalfVector over solid angle.
  virtual double halfVectorDensity(const Eigen::Vector3d& wo, const Eigen::Vector3d& half) const = 0;

 private:
  std::string name_;
  std::uint64_t contentHash_;
};

/// The one-sided, opaque material that consists of the lobe.
BsdfPtr makeMeasuredBsdf(std::shared_ptr<const MeasuredLobe> lobe);

/// Reads the file given by the parameter filename. Errors in reading are rethrown as ParameterError of that parameter.
BsdfPtr makeMeasuredFrom(const Parameters& parameters,
                         std::shared_ptr<const MeasuredLobe> (*read)(const std::filesystem::path& path));

}  // namespace lobe
