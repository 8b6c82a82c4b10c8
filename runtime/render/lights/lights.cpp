#include "runtime/render/lights/lights.h"

#include <algorithm>
#include <cmath>

#include "runtime/render/geometry/shape_geometry.h"
#include "runtime/render/lights/delta_lights.h"

namespace lobe {
namespace {

/// In double precision, because squared areas of very small or large triangles exceed the range of float.
std::vector<double> areasOfTriangles(const TriangleMesh& mesh) {
  std::vector<double> areas;
  areas.reserve(mesh.triangles.size());
  for (const auto& [i, j, k] : mesh.triangles) {
    const Eigen::Vector3d a = mesh.positions[i].cast<double>();
    areas.push_back(0.5 * (mesh.positions[j].cast<double>() - a).cross(mesh.positions[k].cast<double>() - a).norm());
  }
  return areas;
}

/// The area of an analytic shape; 0 for meshes and instances.
float areaOfAnalytic(const Geometry& geometry) {
  if (const auto* sphere = std::get_if<Sphere>(&geometry)) return areaOf(*sphere);
  if (const auto* disk = std::get_if<Disk>(&geometry)) return areaOf(*disk);
  const auto* cylinder = std::get_if<Cylinder>(&geometry);
  return cylinder ? areaOf(*cylinder) : 0.0f;
}

// The cone that a sphere subtends at a point outside, with 1 − cosθ computed without cancellation. nullopt for a point
// inside.
struct Cone {
  Vec3 axis;
  float distance;        // to the centre
  float sine2;           // of the half angle
  float oneMinusCosine;  // solid angle over 2π
};
std::optional<Cone> coneOf(const Sphere& sphere, const Vec3& point) {
  const Vec3 toCentre = sphere.centre - point;
  const float distance = toCentre.norm();
  const float sine = sphere.radius / distance;
  if (!(sine < 1.0f)) return std::nullopt;
  const float sine2 = sine * sine;
  return Cone{toCentre / distance, distance, sine2, sine2 / (1.0f + std::sqrt(1.0f - sine2))};
}

float coneDensity(const Cone& cone) {
  return 0.5f * kInvPi / cone.oneMinusCosine;
}

// Samples a direction uniformly in the cone and finds the first point of the sphere in that direction.
LightSample sampleCone(const Sphere& sphere, const Cone& cone, const Vec2& u) {
  const float oneMinusCosine = u.x() * cone.oneMinusCosine;
  const float cosine = 1.0f - oneMinusCosine;
  const float sine2 = oneMinusCosine * (2.0f - oneMinusCosine);
  const float azimuth = 2.0f * kPi * u.y();
  const float sine = std::sqrt(sine2);
  const Frame frame = Frame::fromNormal(cone.axis);
  LightSample result;
  result.wi = frame.toWorld({sine * std::cos(azimuth), sine * std::sin(azimuth), cosine});
  const float distance = cone.distance;
  const float half = std::sqrt(std::max(0.0f, sphere.radius * sphere.radius - distance * distance * sine2));
  result.distance = distance * cosine - half;
  result.source = pointOnSphere(sphere, (result.distance * result.wi - distance * cone.axis).normalized());
  result.pdf = coneDensity(cone);
  return result;
}

// Converts a density over surface area to one over solid angle; 0 from behind.
float toSolidAngle(float areaDensity, float distance2, float cosine) {
  return cosine > 0.0f ? areaDensity * distance2 / cosine : 0.0f;
}

}  // namespace

Vec3 SceneSphere::start(const Vec3& wi, const Vec2& u) const {
  const Vec2 d = squareToDisk(u) * radius;
  return centre + Frame::fromNormal(wi).toWorld({d.x(), d.y(), radius});
}

Lights::Lights(const Scene& scene, const Eigen::AlignedBox3f& bounds)
    : scene_(scene), lightOfShape_(scene.shapes.size(), -1) {
  if (!bounds.isEmpty()) {
    sphere_ = {bounds.center(), 0.5f * bounds.diagonal().norm()};
  }
  std::vector<double> powers;
  for (std::size_t i = 0; i < scene.shapes.size(); ++i) {
    const Shape& shape = scene.shapes[i];
    if (!shape.emitter) continue;
    AreaLight light{&shape, 0.0f, {}};
    if (const auto* mesh = std::get_if<TriangleMesh>(&shape.geometry)) {
      const std::vector<double> areas = areasOfTriangles(*mesh);
      light.triangles = DiscreteDistribution(areas);
      light.area = static_cast<float>(light.triangles.total());
    } else {
      light.area = areaOfAnalytic(shape.geometry);
    }
    if (!(light.area > 0.0f)) continue;
    lightOfShape_[i] = static_cast<int>(areas_.size());
    powers.push_back(static_cast<double>(kPi) * light.area * luminance(shape.emitter->radiance->mean()));
    areas_.push_back(std::move(light));
  }
  for (const DeltaLight& light : scene.lights) powers.push_back(powerOf(light, sphere_));
  if (scene.environment) {
    environment_.emplace(*scene.environment);
    nextEvent_.emplace(EnvironmentLight::forNextEventEstimation(*scene.environment));
    powers.push_back(environment_->flux() * kPi * sphere_.radius * sphere_.radius);
  }
  choose(powers);
}

// Probability with which a light is chosen uniformly instead of by power. Power does not account for distance: a lamp
// would hardly ever be chosen next to a bright sky, even where only the lamp gives light.
constexpr double kUniformFraction = 0.2;

// In double precision: in very large or small scenes powers may exceed the range of float, but their fractions do not.
void Lights::choose(const std::vector<double>& powers) {
  double total = 0;
  std::size_t shining = 0;
  for (const double power : powers) {
    total += std::max(0.0, power);
    shining += power > 0;
  }
  std::vector<float> weights;
  for (const double power : powers)
    weights.push_back(power > 0 ? static_cast<float>((1 - kUniformFraction) * power / total +
                                                     kUniformFraction / static_cast<double>(shining))
                                : 0.0f);
  choice_ = DiscreteDistribution(weights);
}

Lights::PointSample Lights::samplePoint(const AreaLight& light, double choice, const Vec2& u) const {
  const float density = 1.0f / light.area;
  if (const auto* mesh = std::get_if<TriangleMesh>(&light.shape->geometry)) {
    const auto triangle = static_cast<std::uint32_t>(light.triangles.sample(choice));
    const float root = std::sqrt(u.x());
    return {pointOnTriangle(*mesh, triangle, root * (1.0f - u.y()), root * u.y()), density};
  }
  if (const auto* sphere = std::get_if<Sphere>(&light.shape->geometry))
    return {pointOnSphere(*sphere, squareToSphere(u)), density};
  if (const auto* cylinder = std::get_if<Cylinder>(&light.shape->geometry))
    return {pointOnCylinder(*cylinder, 2.0f * kPi * u.x(), u.y()), density};
  const Vec2 d = squareToDisk(u);
  return {pointOnDisk(std::get<Disk>(light.shape->geometry), d.x(), d.y()), density};
}

std::optional<LightSample> Lights::sampleArea(const AreaLight& light, const Vec3& point, double choice,
                                              const Vec2& u) const {
  LightSample result;
  const auto* sphere = std::get_if<Sphere>(&light.shape->geometry);
  const std::optional<Cone> cone = sphere ? coneOf(*sphere, point) : std::nullopt;
  if (cone) {
    if (sphere->flipped) return std::nullopt;  // emits inwards
    result = sampleCone(*sphere, *cone, u);
  } else {
    const PointSample sample = samplePoint(light, choice, u);
    const Vec3 toLight = sample.point.position - point;
    const float distance2 = toLight.squaredNorm();
    result.distance = std::sqrt(distance2);
    result.wi = toLight / result.distance;
    result.pdf = toSolidAngle(sample.areaDensity, distance2, -sample.point.normal.dot(result.wi));
    result.source = sample.point;
  }
  if (!(result.pdf > 0.0f) || !std::isfinite(result.pdf)) return std::nullopt;
  result.radiance = light.shape->emitter->radiance->eval(result.source->uv);
  return result;
}

std::optional<LightSample> Lights::sampleEnvironment(const Vec2& u) const {
  const std::optional<EnvironmentSample> sample = nextEvent_->sample(u);
  if (!sample) return std::nullopt;
  return LightSample{sample->wi, kInfinity, sample->radiance, sample->pdf, std::nullopt};
}

std::optional<LightSample> Lights::sample(const Vec3& point, double choice, const Vec2& u) const {
  if (empty()) return std::nullopt;
  const std::size_t light = choice_.sample(choice);
  const auto sampleChosen = [&] {
    if (light < areas_.size()) return sampleArea(areas_[light], point, choice, u);
    const std::size_t delta = light - areas_.size();
    return delta < scene_.lights.size() ? illuminate(scene_.lights[delta], point) : sampleEnvironment(u);
  };
  std::optional<LightSample> result = sampleChosen();
  if (result) result->pdf *= choice_.probability(light);
  return result;
}

float Lights::pdf(const Vec3& point, const SurfaceHit& hit) const {
  const int light = lightOfShape_[hit.shape];
  if (light < 0 || hit.normal.dot(hit.woWorld) <= 0.0f || empty()) return 0.0f;
  const AreaLight& area = areas_[light];
  const float choice = choice_.probability(light);
  if (const auto* sphere = std::get_if<Sphere>(&area.shape->geometry))
    if (const std::optional<Cone> cone = coneOf(*sphere, point))
      return sphere->flipped ? 0.0f : choice * coneDensity(*cone);
  const float distance2 = (hit.position - point).squaredNorm();
  return choice * toSolidAngle(1.0f / area.area, distance2, hit.normal.dot(hit.woWorld));
}

Rgb Lights::environmentRadiance(const Vec3& direction) const {
  return environment_ ? environment_->radiance(direction) : Rgb(Rgb::Zero());
}

float Lights::environmentPdf(const Vec3& direction) const {
  const float choice = environmentProbability();
  return choice > 0.0f ? choice * nextEvent_->pdf(direction) : 0.0f;
}

std::optional<EmittedPhoton> Lights::areaPhoton(const AreaLight& light, double choice, const Vec2& u1,
                                                const Vec2& u2) const {
  const PointSample sample = samplePoint(light, choice, u1);
  const Vec3 direction = Frame::fromNormal(sample.point.normal).toWorld(squareToCosineHemisphere(u2));
  const Rgb power = light.shape->emitter->radiance->eval(sample.point.uv) * (kPi / sample.areaDensity);
  return EmittedPhoton{spawnRay(sample.point, direction), power, false, sample.areaDensity, sample.point.normal};
}

EmittedPhoton Lights::photonFromEnvironment(const EnvironmentSample& from, const Vec2& u) const {
  const Rgb power = from.radiance * (kPi * sphere_.radius * sphere_.radius / from.pdf);
  return {{sphere_.start(from.wi, u), -from.wi}, power, true, environmentPdf(from.wi), Vec3::Zero()};
}

Vec2 Lights::photonCoordinates(const Vec3& point, const Vec3& wi) const {
  const Vec3 local = Frame::fromNormal(wi).toLocal(point - sphere_.centre) / sphere_.radius;
  const float azimuth = std::atan2(local.y(), local.x()) * (0.5f * kInvPi);
  return Vec2(local.head<2>().squaredNorm(), azimuth - std::floor(azimuth)).cwiseMin(kOneMinusEpsilon);
}

std::optional<EmittedPhoton> Lights::samplePhoton(double choice, const Vec2& u1, const Vec2& u2) const {
  const std::size_t light = choice_.sample(choice);
  std::optional<EmittedPhoton> photon;
  if (light < areas_.size()) {
    photon = areaPhoton(areas_[light], choice, u1, u2);
    photon->emitterDensity *= choice_.probability(light);
  } else if (const std::size_t delta = light - areas_.size(); delta < scene_.lights.size()) {
    photon = emit(scene_.lights[delta], sphere_, u1, u2);
  } else if (const std::optional<EnvironmentSample> from = environment_->sample(u1)) {
    photon = photonFromEnvironment(*from, u2);
  }
  if (photon) photon->power /= choice_.probability(light);
  return photon;
}

}  // namespace lobe
