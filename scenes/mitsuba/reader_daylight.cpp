#include "scenes/mitsuba/reader_daylight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "scenes/daylight/sun_position.h"
#include "scenes/mitsuba/emission.h"

namespace lobe {
namespace {

constexpr std::array<std::string_view, 3> kTypes = {"sky", "sun", "sunsky"};
constexpr std::array<const char*, 9> kPlaceAndTime = {"year",   "month",    "day",       "hour",    "minute",
                                                      "second", "latitude", "longitude", "timezone"};

double within(const Parameters& parameters, const char* name, double fallback, double low, double high) {
  const double value = parameters.number(name, fallback);
  if (!(value >= low && value <= high))
    throw ParameterError(name, fmt::format("{} must be from {} to {}, not {}", name, low, high, value));
  return value;
}

int integer(const Parameters& parameters, const char* name, int fallback, int low, int high) {
  const double value = within(parameters, name, fallback, low, high);
  if (value != std::floor(value)) throw ParameterError(name, fmt::format("{} must be an integer, not {}", name, value));
  return static_cast<int>(value);
}

DateAndPlace readDateAndPlace(const Parameters& parameters) {
  DateAndPlace when;
  when.year = integer(parameters, "year", when.year, 1901, 2099);
  when.month = integer(parameters, "month", when.month, 1, 12);
  when.day = integer(parameters, "day", when.day, 1, 31);
  when.hour = within(parameters, "hour", when.hour, 0, 24);
  when.minute = within(parameters, "minute", when.minute, 0, 60);
  when.second = within(parameters, "second", when.second, 0, 60);
  when.latitude = within(parameters, "latitude", when.latitude, -90, 90);
  when.longitude = within(parameters, "longitude", when.longitude, -180, 180);
  when.timezone = within(parameters, "timezone", when.timezone, -14, 14);
  return when;
}

/// The sun's direction in the emitter's frame, from date and place or from sun_direction, which is in world space.
Eigen::Vector3d readSunDirection(const Parameters& parameters, const Eigen::Matrix3d& toWorld) {
  if (!parameters.has("sun_direction")) return sunDirection(readDateAndPlace(parameters));
  for (const char* name : kPlaceAndTime)
    if (parameters.has(name)) throw ParameterError(name, fmt::format("give either sun_direction or {}", name));
  const Eigen::Vector3d world = parameters.colour("sun_direction", Rgb::Zero()).matrix().cast<double>();
  if (!(world.norm() > 0)) throw ParameterError("sun_direction", "sun_direction is zero");
  return toWorld.transpose() * world.normalized();
}

void checkAboveHorizon(const Parameters& parameters, const Eigen::Vector3d& sun) {
  if (sun.y() >= 0) return;
  const double degrees = -std::asin(std::max(-1.0, sun.y())) * 180 / std::numbers::pi;
  throw ParameterError(
      parameters.has("sun_direction") ? "sun_direction" : "hour",
      fmt::format("the sun is {:.1f} degrees below the horizon: night skies are not supported", degrees));
}

Eigen::Vector3d stretched(const Eigen::Vector3d& direction, double stretch) {
  const double across = std::hypot(direction.x(), direction.z());
  if (stretch == 1 || !(across > 0)) return direction;
  const double polar = stretch * std::atan2(across, direction.y());
  const double factor = std::sin(polar) / across;
  return {direction.x() * factor, std::cos(polar), direction.z() * factor};
}

/// Angular radius of the sun in radians. Mitsuba 0.6 scales the true radius, Mitsuba 3 takes the angular diameter in
/// degrees. Neither changes the irradiance.
double readSunRadius(const Parameters& parameters) {
  constexpr double kDegree = std::numbers::pi / 180;
  if (!parameters.has("sun_aperture"))
    return within(parameters, "sun_radius_scale", 1, 0, std::floor(90 * kDegree / sunRadius())) * sunRadius();
  if (parameters.has("sun_radius_scale"))
    throw ParameterError("sun_aperture", "give either sun_aperture or sun_radius_scale");
  return 0.5 * within(parameters, "sun_aperture", 0, 0, 180) * kDegree;
}

}  // namespace

/// Reports switches that are on and would change the picture.
void DaylightReader::checkSwitches(pugi::xml_node node, const Parameters& parameters, const std::string& type) {
  const auto refuse = [&](const char* name, const char* what) {
    if (parameters.flag(name, false))
      context_.unsupported(parameters.location(name), fmt::format("{} of {}", name, type),
                           fmt::format("{}: {} is not supported: {}", describe(node), name, what),
                           fmt::format("{} is ignored", name));
  };
  if (type != "sun") refuse("extend", "the sky ends at the horizon");
  if (type != "sky") refuse("complex_sun", "the sun's disc has uniform radiance");
}

bool DaylightReader::knows(std::string_view type) {
  return std::ranges::find(kTypes, type) != kTypes.end();
}

void DaylightReader::add(pugi::xml_node node, const Parameters& parameters, const std::string& type) {
  makeFrom(context_, node, parameters, [&](const Parameters& p) { return read(node, p, type); });
}

bool DaylightReader::read(pugi::xml_node node, const Parameters& parameters, const std::string& type) {
  readSamplingWeight(context_, node, parameters);
  checkSwitches(node, parameters, type);
  const Eigen::Matrix3d toWorld = rotationOf(parameters, "to_world").cast<double>();
  const double turbidity = within(parameters, "turbidity", 3, 1, 10);
  const double stretch = within(parameters, "stretch", 1, 1, 2);
  const double scale = emissionScale(parameters, "scale", 1);
  const Eigen::Vector3d sun = readSunDirection(parameters, toWorld);
  checkAboveHorizon(parameters, sun);
  const int width = integer(parameters, "resolution", 1024, 8, 1 << 14);
  const double skyScale = type == "sunsky" ? emissionScale(parameters, "sky_scale", scale) : scale;
  const double sunScale = type == "sunsky" ? emissionScale(parameters, "sun_scale", scale) : scale;
  const double radius = type == "sky" ? 0 : readSunRadius(parameters);
  const Rgb sunlight = sunRadiance(turbidity, std::acos(std::min(1.0, sun.y()))) * static_cast<float>(sunScale);
  if (type != "sky")
    checkEmission(type == "sunsky" && parameters.has("sun_scale") ? "sun_scale" : "scale",
                  "the radiance of the sun times scale", sunlight);
  if (type != "sun" && parameters.has("albedo")) {
    parameters.colour("albedo", Rgb::Zero());
    parameters.warn("albedo", "albedo is ignored: Preetham's sky does not depend on the ground");
  }
  if (context_.file.isOfToday())
    context_.note(fmt::format("{}: the zenith is +y, as in Mitsuba 0.6; in Mitsuba 3 it is +z", describe(node)));
  // Nothing is stored before everything has been read, because an element that throws is read again.
  if (!any()) {
    frame_ = toWorld;
    location_ = SceneFile::location(node);
  }
  width_ = std::max(width_, width);
  if (type != "sun") {
    if (turbidity < PreethamSky::kLowestTurbidity)
      context_.note(fmt::format("{}: turbidity {} is replaced by {}, the lowest of Preetham's sky model",
                                describe(node), turbidity, PreethamSky::kLowestTurbidity));
    const double clearest = std::max(turbidity, PreethamSky::kLowestTurbidity);
    parts_.skies.push_back({PreethamSky(clearest, sun), toWorld, skyScale, stretch});
  }
  if (type != "sky") addSun(toWorld * stretched(sun, stretch), sunlight, radius);
  return true;
}

void DaylightReader::addSun(const Eigen::Vector3d& world, const Rgb& radiance, double radius) {
  const double sine = std::sin(0.5 * sunRadius());
  const Rgb irradiance = radiance * static_cast<float>(4 * std::numbers::pi * sine * sine);
  if (radius > 0)
    parts_.suns.push_back({world, irradiance, radius});
  else if (context_.options.geometry)
    context_.scene.lights.push_back(DirectionalLight{-world.cast<float>(), irradiance});
}

void DaylightReader::finish() {
  if (parts_.skies.empty() && parts_.suns.empty()) return;
  if (!context_.options.geometry) return;
  Environment environment = bakeDaylight(parts_, frame_, width_);
  const auto isTooLarge = [](const Rgb& pixel) { return !(pixel <= kLargestEmission).all(); };
  if (std::ranges::any_of(environment.radiance.pixels, isTooLarge)) {
    const std::string message =
        fmt::format("the radiance of all skies and suns together must not be over {:g}", kLargestEmission);
    return context_.unsupported(location_, message, message, "they are left out");
  }
  context_.scene.environment = std::move(environment);
}

}  // namespace lobe
