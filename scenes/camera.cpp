#include "scenes/camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lobe {
namespace {

/// The length in the image plane that the axis is measured along, in the same unit as width and height.
double extentAlong(const std::string& axis, double width, double height) {
  if (axis == "y") return height;
  if (axis == "diagonal") return std::hypot(width, height);
  if (axis == "smaller") return std::min(width, height);
  if (axis == "larger") return std::max(width, height);
  return width;
}

}  // namespace

float horizontalFov(const Camera& camera, int width, int height) {
  constexpr double kDegree = std::numbers::pi / 180;
  const double tangent = std::tan(0.5 * camera.fov * kDegree) * width / extentAlong(camera.fovAxis, width, height);
  return static_cast<float>(2 * std::atan(tangent) / kDegree);
}

}  // namespace lobe
