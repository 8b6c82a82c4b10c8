#pragma once
// The emitters sky, sun and sunsky of scene files.

#include "scenes/daylight/daylight_image.h"
#include "scenes/mitsuba/reader_parameters.h"

namespace lobe {

class DaylightReader {
 public:
  explicit DaylightReader(ReadContext& context) : context_(context) {}

  static bool knows(std::string_view type);
  /// Reads the element and keeps the result for finish(). Throws SceneError.
  void add(pugi::xml_node node, const Parameters& parameters, const std::string& type);
  /// Whether add has been called.
  bool any() const { return width_ > 0; }
  /// Adds the sum of all elements to the scene: one environment, and a directional light for each sun of radius 0.
  void finish();

 private:
  bool read(pugi::xml_node node, const Parameters& parameters, const std::string& type);
  void checkSwitches(pugi::xml_node node, const Parameters& parameters, const std::string& type);
  void addSun(const Eigen::Vector3d& world, const Rgb& radiance, double radius);

  ReadContext& context_;
  DaylightParts parts_;
  Eigen::Matrix3d frame_ = Eigen::Matrix3d::Identity();  // of the first emitter: the frame of the image
  std::ptrdiff_t location_ = 0;                          // of the first emitter
  int width_ = 0;
};

}  // namespace lobe
