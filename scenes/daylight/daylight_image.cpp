#include "scenes/daylight/daylight_image.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "runtime/core/frame.h"
#include "runtime/core/parallel.h"

namespace lobe {
namespace {

constexpr double kPiD = std::numbers::pi;

/// The convention of scene.h: polar angle from +y, azimuth from −z towards +x.
Eigen::Vector3d fromAngles(double polar, double azimuth) {
  return {std::sin(azimuth) * std::sin(polar), std::cos(polar), -std::cos(azimuth) * std::sin(polar)};
}
double polarOf(const Eigen::Vector3d& d) {
  return std::atan2(std::hypot(d.x(), d.z()), d.y());
}
double azimuthOf(const Eigen::Vector3d& d) {
  const double azimuth = std::atan2(d.x(), -d.z());
  return azimuth < 0 ? azimuth + 2 * kPiD : azimuth;
}

Rgb radianceOf(const SkyDome& dome, const Eigen::Vector3d& world) {
  const Eigen::Vector3d local = dome.toWorld.transpose() * world;
  return dome.sky.radiance(fromAngles(polarOf(local) / dome.stretch, azimuthOf(local))) *
         static_cast<float>(dome.scale);
}

/// Solid angle of a pixel of this row under bilinear interpolation, ∫ weight dω. The first and the last row also cover
/// the range from their centres to the poles.
double solidAngle(int row, int width, int height) {
  const double step = kPiD / height;
  const double column = 2 * kPiD / width;
  if (row == 0 || row == height - 1) return column * (1 - (std::sin(1.5 * step) - std::sin(0.5 * step)) / step);
  const double half = std::sin(0.5 * step);
  return column * std::sin((row + 0.5) * step) * 4 * half * half / step;
}

class SunPainter {
 public:
  SunPainter(Image& image, const Eigen::Matrix3d& toWorld) : image_(image), toWorld_(toWorld) {}

  /// Distributes small equal parts of the disc to the four pixels that interpolation in their directions uses, which
  /// preserves both power and mean direction.
  void paint(const SunDisc& sun) const {
    const double pixel = kPiD / image_.height;
    // Parts of a very large disc are about as large as a pixel, so that their number stays bounded.
    const int parts = static_cast<int>(std::clamp(std::ceil(16 * sun.radius / pixel), 64.0, 4096.0));
    const Rgb fraction = sun.irradiance / static_cast<float>(parts * static_cast<double>(parts));
    const Eigen::Vector3d centre = toWorld_.transpose() * sun.direction;
    const Eigen::Vector3d side = centre.unitOrthogonal();
    const Eigen::Vector3d other = centre.cross(side);
    const double sine = std::sin(0.5 * sun.radius);
    for (int i = 0; i < parts; ++i) {
      throwIfCancelled();
      const double below = 2 * sine * sine * (i + 0.5) / parts;  // 1 − cos of the angle from the centre
      const double radius = std::sqrt(below * (2 - below));
      for (int j = 0; j < parts; ++j) {
        const double turn = 2 * kPiD * (j + 0.5) / parts;
        deposit((1 - below) * centre + radius * (std::cos(turn) * side + std::sin(turn) * other), fraction);
      }
    }
  }

 private:
  void deposit(const Eigen::Vector3d& direction, const Rgb& irradiance) const {
    const double x = azimuthOf(direction) / (2 * kPiD) * image_.width - 0.5;
    const double y = polarOf(direction) / kPiD * image_.height - 0.5;
    const int left = static_cast<int>(std::floor(x)), top = static_cast<int>(std::floor(y));
    const double fx = x - left, fy = y - top;
    add(left, top, irradiance, (1 - fx) * (1 - fy));
    add(left + 1, top, irradiance, fx * (1 - fy));
    add(left, top + 1, irradiance, (1 - fx) * fy);
    add(left + 1, top + 1, irradiance, fx * fy);
  }

  void add(int x, int y, const Rgb& irradiance, double weight) const {
    const int column = (x + image_.width) % image_.width;
    const int row = std::clamp(y, 0, image_.height - 1);
    image_.at(column, row) += irradiance * static_cast<float>(weight / solidAngle(row, image_.width, image_.height));
  }

  Image& image_;
  Eigen::Matrix3d toWorld_;
};

}  // namespace

Environment bakeDaylight(const DaylightParts& parts, const Eigen::Matrix3d& toWorld, int width) {
  Image image(width, width / 2);
  parallelFor(0, image.height, [&](int y) {
    for (int x = 0; x < image.width; ++x) {
      const Eigen::Vector3d local = fromAngles(kPiD * (y + 0.5) / image.height, 2 * kPiD * (x + 0.5) / image.width);
      for (const SkyDome& dome : parts.skies) image.at(x, y) += radianceOf(dome, toWorld * local);
    }
  });
  const SunPainter painter(image, toWorld);
  for (const SunDisc& sun : parts.suns) painter.paint(sun);
  return {std::move(image), toWorld.cast<float>()};
}

}  // namespace lobe
