#include "runtime/render/lights/lights.h"

#include <algorithm>
#include <cmath>
#include <limits>

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

// Upper bound of the number of tiles of the environment.
constexpr int kMaxTiles = 128;

// Converts a density over surface area to one over solid angle; 0 from behind.
float toSolidAngle(float areaDensity, float distance2, float cosine) {
  return cosine > 0.0f ? areaDensity * distance2 / cosine : 0.0f;
}

}  // namespace

Vec3 SceneSphere::start(const Vec3& wi, const Vec2& u) const {
  const Vec2 d = squareToDisk(u) * radius;
  return centre + Frame::fromNormal(wi).toWorld({d.x(), d.y(), radius});
}

std::optional<Vec2> SceneSphere::coordinates(const Vec3& point, const Vec3& wi) const {
  const Vec3 local = Frame::fromNormal(wi).toLocal(point - centre) / radius;
  const float radial = local.head<2>().squaredNorm();
  if (!(radial < 1)) return std::nullopt;
  const float azimuth = std::atan2(local.y(), local.x()) * (0.5f * kInvPi);
  return Vec2(radial, std::min(azimuth - std::floor(azimuth), kOneMinusEpsilon));
}

Lights::Lights(const Scene& scene, const Eigen::AlignedBox3f& bounds)
    : scene_(scene), lightOfShape_(scene.shapes.size(), -1) {
  if (!bounds.isEmpty()) {
    sphere_ = region_ = {bounds.center(), 0.5f * bounds.diagonal().norm()};
  }
  for (std::size_t i = 0; i < scene.shapes.size(); ++i) {
    if (!scene.shapes[i].emitter) continue;
    AreaLight light = areaLight(scene.shapes[i]);
    if (!(light.area > 0.0f)) continue;
    lightOfShape_[i] = static_cast<int>(areas_.size());
    areas_.push_back(std::move(light));
  }
  if (scene.environment) {
    environment_.emplace(*scene.environment);
    nextEvent_.emplace(EnvironmentLight::forNextEventEstimation(*scene.environment));
    if (environment_->flux() > 0) nextEvent_->divide(kMaxTiles);
  }
  makeChoices();
}

void Lights::focus(const Eigen::AlignedBox3f& region) {
  if (!region.isEmpty()) region_ = {region.center(), 0.5f * region.diagonal().norm()};
  makeChoices();
}

void Lights::makeChoices() {
  const std::vector<double> all = powers();
  choose(all);
  clusters_.clear();
  cells_ = {};
  if (!empty()) makeClusters(all);
}

Lights::AreaLight Lights::areaLight(const Shape& shape) const {
  const auto* mesh = std::get_if<TriangleMesh>(&shape.geometry);
  if (!mesh) return {&shape, areaOfAnalytic(shape.geometry), {}};
  DiscreteDistribution triangles(areasOfTriangles(*mesh));
  const auto area = static_cast<float>(triangles.total());
  return {&shape, area, std::move(triangles)};
}

std::vector<double> Lights::powers() const {
  std::vector<double> all;
  for (const AreaLight& light : areas_)
    all.push_back(static_cast<double>(kPi) * light.area * luminance(light.shape->emitter->radiance->mean()));
  for (const DeltaLight& light : scene_.lights) all.push_back(powerOf(light, region_));
  if (environment_) all.push_back(environment_->flux() * kPi * region_.radius * region_.radius);
  return all;
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
  weights.reserve(powers.size());
  for (const double power : powers)
    weights.push_back(power > 0 ? static_cast<float>((1 - kUniformFraction) * power / total +
                                                     kUniformFraction / static_cast<double>(shining))
                                : 0.0f);
  choice_ = DiscreteDistribution(weights);
}

namespace {

/// Upper bound of the number of clusters of lights at finite distance.
constexpr std::size_t kMaxTreeClusters = 64;

/// The nodes of a tree that divide its lights into at most `most` groups, in the order of the tree. Strong and extended
/// nodes are divided first.
std::vector<int> cut(const LightTree& tree, std::size_t most) {
  if (tree.empty()) return {};
  std::vector<int> nodes{LightTree::kRoot};
  const auto priority = [&](int node) { return tree.children(node) ? tree.power(node) * tree.radius(node) : -1.0f; };
  while (nodes.size() < most) {
    const auto largest = std::ranges::max_element(nodes, {}, priority);
    const auto below = tree.children(*largest);
    if (!below) break;
    *largest = below->first;
    nodes.push_back(below->second);
  }
  std::ranges::sort(nodes);
  return nodes;
}

/// The cone that contains the normals of a mesh.
void setNormals(const TriangleMesh& mesh, LightBounds& bounds) {
  Vec3 sum = Vec3::Zero();
  std::vector<Vec3> normals;
  for (const auto& [i, j, k] : mesh.triangles) {
    const Vec3& a = mesh.positions[i];
    const Vec3 normal = (mesh.positions[j] - a).stableNormalized().cross((mesh.positions[k] - a).stableNormalized());
    if (!(normal.squaredNorm() > 0.0f)) continue;
    normals.push_back(normal.normalized());
    sum += normals.back();
  }
  if (!(sum.norm() > 0.0f)) return;
  bounds.axis = sum.normalized();
  bounds.normalCosine = 1.0f;
  // A little wider, because of rounding.
  for (const Vec3& normal : normals) bounds.normalCosine = std::min(bounds.normalCosine, normal.dot(bounds.axis));
  bounds.normalCosine = std::max(-1.0f, bounds.normalCosine - 1e-5f);
}

LightBounds boundsOfShape(const Geometry& geometry) {
  LightBounds bounds;
  if (const auto* mesh = std::get_if<TriangleMesh>(&geometry)) {
    bounds.box = boundsOf(*mesh);
    setNormals(*mesh, bounds);
  } else if (const auto* disk = std::get_if<Disk>(&geometry)) {
    bounds.box = boundsOf(*disk);
    bounds.axis = pointOnDisk(*disk, 0, 0).normal;
    bounds.normalCosine = 1.0f;
  } else if (const auto* sphere = std::get_if<Sphere>(&geometry)) {
    bounds.box = boundsOf(*sphere);
  } else if (const auto* cylinder = std::get_if<Cylinder>(&geometry)) {
    bounds.box = boundsOf(*cylinder);
  }
  return bounds;
}

// Delta lights have a cone of axes, beyond which nothing is emitted.
LightBounds boundsOfDelta(const PointLight& light) {
  return {{light.position, light.position}};
}
LightBounds boundsOfDelta(const SpotLight& light) {
  return {{light.position, light.position}, light.direction, std::cos(light.cutoff), 1.0f};
}
LightBounds boundsOfDelta(const ProjectorLight& light) {
  return {{light.position, light.position}, light.direction, 0.0f, 1.0f};
}
LightBounds boundsOfDelta(const DirectionalLight&) {
  return {};  // not in the tree
}

}  // namespace

LightBounds Lights::boundsForTree(int light, double power) const {
  LightBounds bounds = isArea(light) ? boundsOfShape(areas_[light].shape->geometry)
                                     : std::visit([](const auto& l) { return boundsOfDelta(l); }, deltaLight(light));
  bounds.power = power;
  return bounds;
}

void Lights::makeClusters(const std::vector<double>& powers) {
  const auto localLights = static_cast<int>(areas_.size() + scene_.lights.size());
  std::vector<LightBounds> bounds;
  bounds.reserve(localLights);
  for (int i = 0; i < localLights; ++i) bounds.push_back(boundsForTree(i, powers[i]));
  tree_ = LightTree(bounds);
  clusterOf_.assign(localLights, -1);
  std::vector<double> probabilities;
  const auto add = [&](const Cluster& cluster, const std::vector<int>& lights) {
    double sum = 0;
    for (const int light : lights) {
      clusterOf_[light] = clusters();
      sum += choice_.probability(light);
    }
    probabilities.push_back(sum);
    clusters_.push_back(cluster);
  };
  for (const int node : cut(tree_, kMaxTreeClusters)) add({.node = node}, tree_.lightsOf(node));
  for (int i = 0; i < localLights; ++i)
    if (powers[i] > 0 && bounds[i].box.isEmpty()) add({.light = i}, {i});
  if (environmentProbability() > 0) {
    for (int tile = 0; tile < nextEvent_->tiles(); ++tile) {
      probabilities.push_back(environmentProbability() * nextEvent_->tileFraction(tile));
      clusters_.push_back({.tile = tile});
    }
  }
  prior_ = cumulative(probabilities);
}

float Lights::importance(int cluster, const LightReceiver& at) const {
  const int node = clusters_[cluster].node;
  return node >= 0 ? tree_.importance(node, at) : prior(cluster);
}

LightReceiver Lights::receiver(const SurfaceHit& hit) {
  const Vec3 normal = hit.normal.dot(hit.woWorld) < 0 ? Vec3(-hit.normal) : hit.normal;
  return {hit.position, hit.bsdf && hit.bsdf->transmits() ? Vec3(Vec3::Zero()) : normal};
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

std::optional<LightSample> Lights::sampleLight(int light, const Vec3& point, double choice, const Vec2& u) const {
  return isArea(light) ? sampleArea(areas_[light], point, choice, u) : illuminate(deltaLight(light), point);
}

float Lights::pdfOfArea(const AreaLight& light, const Vec3& point, float distance2, float cosine) {
  if (const auto* sphere = std::get_if<Sphere>(&light.shape->geometry))
    if (const std::optional<Cone> cone = coneOf(*sphere, point)) return sphere->flipped ? 0.0f : coneDensity(*cone);
  return toSolidAngle(1.0f / light.area, distance2, cosine);
}

int LightSelection::chooseCluster(double& choice) const {
  constexpr double kMost = 1 - std::numeric_limits<double>::epsilon() / 2;
  const int clusters = lights_->clusters();
  if (clusters <= 1) return 0;
  const float* const above = std::upper_bound(probabilities_ + 1, probabilities_ + clusters, choice);
  const double low = above[-1];
  choice = std::clamp((choice - low) / (above[0] - low), 0.0, kMost);
  return static_cast<int>(above - probabilities_) - 1;
}

std::optional<LightSample> LightSelection::sample(double choice, const Vec2& u) const {
  const int cluster = chooseCluster(choice);
  return sample(cluster, choice, u);
}

std::optional<LightSample> LightSelection::sample(int cluster, double choice, const Vec2& u) const {
  if (lights_->empty()) return std::nullopt;
  const auto& [node, distant, tile] = lights_->clusters_[cluster];
  if (tile >= 0) return sampleTile(cluster, tile, u);
  LightTree::Choice chosen{distant, 1.0f};
  if (node >= 0) {
    const std::optional<LightTree::Choice> below = lights_->tree_.sample(node, at_, choice);
    if (!below) return std::nullopt;
    chosen = *below;
  }
  std::optional<LightSample> result = lights_->sampleLight(chosen.light, at_.position, choice, u);
  if (result) result->pdf *= clusterProbability(cluster) * chosen.probability, result->light = chosen.light;
  return result;
}

std::optional<LightSample> LightSelection::sampleTile(int cluster, int tile, const Vec2& u) const {
  const CumulativeProbabilities tiles = CumulativeProbabilities(probabilities_).from(cluster - tile);
  const std::optional<EnvironmentSample> sample = lights_->nextEvent_->sample(tile, u, tiles);
  if (!sample) return std::nullopt;
  return LightSample{sample->wi, kInfinity, sample->radiance, sample->pdf, std::nullopt};
}

std::optional<LightSample> LightSelection::same(const LightSample& sample) const {
  std::optional<LightSample> result = sample;
  if (sample.light < 0) {
    result->pdf = environmentPdf(sample.wi);
    return result;
  }
  const float choice = probability(sample.light);
  if (sample.delta) {
    result = illuminate(lights_->deltaLight(sample.light), at_.position);
    if (result) result->pdf = choice, result->light = sample.light;
    return result;
  }
  const Vec3 toLight = sample.source->position - at_.position;
  const float distance2 = toLight.squaredNorm();
  result->distance = std::sqrt(distance2);
  result->wi = toLight / result->distance;
  const float cosine = -sample.source->normal.dot(result->wi);
  if (!(cosine > 0.0f)) return std::nullopt;
  result->pdf = choice * Lights::pdfOfArea(lights_->areas_[sample.light], at_.position, distance2, cosine);
  return result;
}

float LightSelection::probability(int light) const {
  const int cluster = lights_->clusterOf_[light];
  if (cluster < 0) return 0.0f;
  const int node = lights_->clusters_[cluster].node;
  return clusterProbability(cluster) * (node >= 0 ? lights_->tree_.probability(node, at_, light) : 1.0f);
}

float LightSelection::pdf(const SurfaceHit& hit) const {
  const int light = lights_->lightOfShape_[hit.shape];
  const float cosine = hit.normal.dot(hit.woWorld);
  if (light < 0 || cosine <= 0.0f || lights_->empty()) return 0.0f;
  const float distance2 = (hit.position - at_.position).squaredNorm();
  return probability(light) * Lights::pdfOfArea(lights_->areas_[light], at_.position, distance2, cosine);
}

float LightSelection::pdf(const EmittedPhoton& photon, float distance) const {
  if (photon.light < 0) return environmentPdf(-photon.ray.direction);
  const float choice = probability(photon.light);
  const float distance2 = distance * distance;
  if (photon.delta) return photon.far ? choice : choice * distance2;
  return choice * Lights::pdfOfArea(lights_->areas_[photon.light], at_.position, distance2, photon.cosine());
}

float LightSelection::environmentPdf(const Vec3& direction) const {
  if (!(lights_->environmentProbability() > 0.0f)) return 0.0f;
  const int first = lights_->clusters() - lights_->nextEvent_->tiles();
  return lights_->nextEvent_->pdf(direction, CumulativeProbabilities(probabilities_).from(first));
}

Rgb Lights::environmentRadiance(const Vec3& direction) const {
  return environment_ ? environment_->radiance(direction) : Rgb(Rgb::Zero());
}

std::optional<EmittedPhoton> Lights::areaPhoton(const AreaLight& light, double choice, const Vec2& u1,
                                                const Vec2& u2) const {
  const PointSample sample = samplePoint(light, choice, u1);
  const Vec3 direction = Frame::fromNormal(sample.point.normal).toWorld(squareToCosineHemisphere(u2));
  const Rgb power = light.shape->emitter->radiance->eval(sample.point.uv) * (kPi / sample.areaDensity);
  EmittedPhoton photon{spawnRay(sample.point, direction), power, false};
  photon.areaDensity = sample.areaDensity;
  photon.normal = sample.point.normal;
  photon.density = sample.areaDensity * photon.cosine() * kInvPi;
  return photon;
}

float Lights::photonDensity(const SurfaceHit& hit) const {
  const int light = lightOfShape_[hit.shape];
  const float cosine = hit.normal.dot(hit.woWorld);
  if (light < 0 || cosine <= 0.0f || empty()) return 0.0f;
  return choice_.probability(light) / areas_[light].area * cosine * kInvPi;
}

float Lights::environmentPhotonDensity(const Vec3& direction) const {
  const float choice = environmentProbability();
  return choice > 0.0f ? choice * photonDensityOfEnvironment(direction) : 0.0f;
}

float Lights::photonDensityOfEnvironment(const Vec3& direction) const {
  return environment_->pdf(direction) / sphere_.discArea();
}

float Lights::photonDensity(const LightSample& sample) const {
  if (sample.light < 0) return environmentPhotonDensity(sample.wi);
  const float choice = choice_.probability(sample.light);
  if (sample.delta) return choice * emissionDensity(deltaLight(sample.light), sphere_, -sample.wi);
  return choice / areas_[sample.light].area * std::abs(sample.source->normal.dot(sample.wi)) * kInvPi;
}

EmittedPhoton Lights::photonFromEnvironment(const EnvironmentSample& from, const SceneSphere& sphere,
                                            const Vec2& u) const {
  const Rgb power = from.radiance * (sphere.discArea() / from.pdf);
  // Photons start `radius` from the centre, and must start outside the scene.
  const float beyond = std::max(0.0f, (sphere.centre - sphere_.centre).norm() + sphere_.radius - sphere.radius);
  EmittedPhoton photon{{sphere.start(from.wi, u) + beyond * from.wi, -from.wi}, power, true};
  photon.density = from.pdf / sphere.discArea();
  return photon;
}

std::optional<EmittedPhoton> Lights::photonFromEnvironment(const Vec2& u1, const Vec2& u2) const {
  const std::optional<EnvironmentSample> from = environment_->sample(u1);
  return from ? std::optional(photonFromEnvironment(*from, sphere_, u2)) : std::nullopt;
}

std::optional<EmittedPhoton> Lights::samplePhoton(double choice, const Vec2& u1, const Vec2& u2) const {
  const std::size_t light = choice_.sample(choice);
  std::optional<EmittedPhoton> photon;
  if (light < areas_.size()) {
    photon = areaPhoton(areas_[light], choice, u1, u2);
  } else if (const std::size_t delta = light - areas_.size(); delta < scene_.lights.size()) {
    photon = emit(scene_.lights[delta], sphere_, u1, u2);
  } else {
    photon = photonFromEnvironment(u1, u2);
  }
  if (!photon) return std::nullopt;
  photon->power /= choice_.probability(light);
  photon->density *= choice_.probability(light);
  if (light < areas_.size() + scene_.lights.size()) photon->light = static_cast<int>(light);
  return photon;
}

}  // namespace lobe
