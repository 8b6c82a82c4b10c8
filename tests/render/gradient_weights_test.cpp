// The weights of gradient-domain path tracing, and of bidirectional path tracing. For random base paths and light
// paths, everything that a sample adds is computed again from whole paths: the densities of all techniques by explicit
// formulas, for the base path and the offset path, and with them the weights by their definitions. Hence those of all
// techniques of a path sum to one, and those of all techniques that shift two paths to each other, from both sides,
// too.

#include <array>
#include <sstream>

#include <catch2/catch.hpp>

#include "runtime/render/gradients/gradient_bidirectional_path.h"
#include "runtime/render/gradients/gradient_path.h"
#include "runtime/render/gradients/half_vector.h"
#include "tests/support/explicit_paths.h"
#include "tests/support/render_test_tools.h"
#include "tests/support/scenes_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

using Value = Eigen::Array3d;

struct ShiftedExplicitPath {
  ExplicitPath path;
  double jacobian;  ///< in the measure of ExplicitPath
  int first;        ///< the techniques from this one on shift alike
  bool own;         ///< only the given technique does
};

/// The shift of paths (shifted_path.h, gradient_bidirectional_path.h).
class Shift {
 public:
  Shift(const RenderScene& scene, const RayCamera& camera) : scene_(scene), camera_(camera) {}

  /// The offset path of a path that technique t has sampled, through another camera ray.
  std::optional<ShiftedExplicitPath> operator()(const ExplicitPath& base, const Ray& ray, int t) const {
    std::uint64_t rays = 0;
    const auto hit = scene_.firstVisible(ray, EmitterVisibility::shown, rays);
    if (!hit || !arrives(*hit)) return std::nullopt;
    Walk walk{base, ray, t, base.vertices, base.origin};
    walk.vertices[0].hit = *hit;
    for (int k = 0;; ++k) {
      if (!base.vertices[k].delta && (t == k + 1 || isConnected(base, k))) return connected(walk, k);
      if (t < k + 2 || !copied(walk, k)) return std::nullopt;
      if (k + 1 == base.size()) return result(walk, false);
    }
  }

 private:
  struct Walk {
    const ExplicitPath& base;
    Ray ray;
    int t;
    std::vector<PathVertex> vertices;
    LightOrigin origin;
    double jacobian = 1;
    int first = 0;
  };

  static bool arrives(const SurfaceHit& hit) { return hit.bsdf && sidesAgree(hit, hit.woWorld, hit.wo); }

  static bool broad(const SurfaceHit& at, const Vec3& direction) {
    return scattersBroadly(at, evalBsdf(at, at.frame.toLocal(direction)));
  }
  static bool corresponds(const ExplicitPath& base, const ExplicitPath& offset, int k) {
    const SurfaceHit a = base.fromCamera(k), b = offset.fromCamera(k);
    return correspond(a, a.frame.toLocal(base.towardsLight(k)), b, b.frame.toLocal(offset.towardsLight(k)));
  }

  static bool isConnected(const ExplicitPath& base, int k) {
    return broad(base.fromCamera(k), base.towardsLight(k)) &&
           (k + 1 == base.size() || connectable(base.fromCamera(k + 1)));
  }

  ShiftedExplicitPath result(const Walk& walk, bool own) const {
    return {ExplicitPath(scene_, camera_, walk.ray, walk.vertices, walk.origin), walk.jacobian, walk.first, own};
  }

  // Both paths have the same vertices from k + 1 on.
  std::optional<ShiftedExplicitPath> connected(const Walk& walk, int k) const {
    ShiftedExplicitPath offset = result(walk, false);
    if (!offset.path.visible(k)) return std::nullopt;
    bool alike = isConnected(walk.base, k) && isConnected(offset.path, k) && corresponds(walk.base, offset.path, k);
    const bool atEnd = k + 1 == walk.base.size();
    if (alike && !atEnd) {
      const SurfaceHit a = walk.base.fromCamera(k + 1), b = offset.path.fromCamera(k + 1);
      const bool sides = arrives(b) && a.wo.z() * b.wo.z() > 0;
      alike = sides && corresponds(walk.base, offset.path, k + 1);
      if (sides && !alike && walk.t == k + 2) offset.own = true;
      if (walk.base.vertices[k + 1].delta) return std::nullopt;
    }
    if (walk.t == k + 1) offset.own = !alike;
    if (!alike && !offset.own) return std::nullopt;
    return offset;
  }

  static std::optional<ShiftedDirection> copiedDelta(const SurfaceHit& base, const SurfaceHit& at, double component) {
    const auto from = deltaComponent(base, component), to = deltaComponent(at, component);
    if (!from || !to || (from->eta == 1) != (to->eta == 1)) return std::nullopt;
    return ShiftedDirection{to->wi, 1};
  }

  static std::optional<ShiftedDirection> copiedHalfVector(const SurfaceHit& base, const Vec3& direction, float eta,
                                                          const SurfaceHit& at) {
    if (!(base.frame.n.dot(at.frame.n) > 0) || at.bsdf->deltaProbability(at.wo, at.uv) >= 1) return std::nullopt;
    const auto rotation = Eigen::Quaternionf::FromTwoVectors(base.frame.n, at.frame.n);
    const auto rotated = [&](const Vec3& world) -> Vec3 { return at.frame.toLocal(rotation * world); };
    auto shifted = copyHalfVector(rotated(base.woWorld), rotated(direction), eta, at.wo);
    if (shifted && !correspond(base, base.frame.toLocal(direction), at, shifted->wi)) shifted.reset();
    return shifted;
  }

  // Copies the delta component or the half vector at vertex k; returns false if that fails.
  bool copied(Walk& walk, int k) const {
    const PathVertex& vertex = walk.base.vertices[k];
    const SurfaceHit at = walk.vertices[k].hit, base = walk.base.fromCamera(k);
    const Vec3 onwards = walk.base.towardsLight(k);
    const auto shifted =
        vertex.delta ? copiedDelta(base, at, *vertex.delta) : copiedHalfVector(base, onwards, vertex.eta, at);
    if (!shifted) return false;
    const bool reflects = base.wo.z() * base.frame.toLocal(onwards).z() > 0;
    const Vec3 direction = at.frame.toWorld(shifted->wi).normalized();
    if (!sidesAgree(at, direction, shifted->wi) || reflects != (at.wo.z() * shifted->wi.z() > 0)) return false;
    const auto next = scene_.tracer.trace(spawnRay(at, direction));
    // A path would be shifted back by a connection.
    if (!vertex.delta && broad(at, direction) && (!next || connectable(*next))) return false;
    if (!moveNext(walk, k, next, direction)) return false;
    const ExplicitPath offset(scene_, camera_, walk.ray, walk.vertices, walk.origin);
    walk.jacobian *= shifted->jacobian * walk.base.areaOfNext(k) / offset.areaOfNext(k);
    walk.first = k + 2;
    return true;
  }

  // The offset path has arrived at `next`, or left the scene. Returns false if the base path has not done the same.
  static bool moveNext(Walk& walk, int k, const std::optional<SurfaceHit>& next, const Vec3& direction) {
    if (k + 1 < walk.base.size()) {
      if (!next || !arrives(*next)) return false;
      walk.vertices[k + 1].hit = *next;
      return true;
    }
    if (next.has_value() != walk.base.origin.surface.has_value()) return false;
    walk.origin.surface = next;
    walk.origin.direction = direction;
    return true;
  }

  const RenderScene& scene_;
  const RayCamera& camera_;
};

enum class Techniques { camera, bidirectional };

double sumOfSquares(const ExplicitPath& path, Techniques techniques, int first = 0) {
  double sum = 0;
  for (int t = std::max(first, techniques == Techniques::camera ? path.size() : 0); t <= path.size() + 1; ++t)
    sum += squared(path.density(t));
  return sum;
}

/// What was compared: pairs of paths by their number of vertices and the technique.
struct Coverage {
  std::array<std::array<int, 7>, 5> pairs{};  ///< n = 1 … 5
  int samples = 0, failed = 0;
  int shifts = 0, irreversible = 0;
  std::string lastFailure;
};

/// A sum with the sum of the magnitudes of its terms, by which rounding is judged.
struct Sum {
  Value value = Value::Zero(), magnitude = Value::Zero();
  void add(const Value& x) { value += x, magnitude += x.abs(); }
  bool equals(const Rgb& other) const {
    return ((other.cast<double>() - value).abs() <= 1e-2 * magnitude + 1e-9).all();
  }
};

struct ExpectedSample {
  Sum radiance;
  std::array<Sum, kNeighbours.size()> differences;
};

class Oracle {
 public:
  Oracle(const RenderScene& scene, const RayCamera& camera, const PathOptions& options, Techniques techniques,
         Coverage& coverage)
      : options_(options), techniques_(techniques), shift_(scene, camera), coverage_(coverage) {}

  /// Adds what technique t contributes, which has sampled this path and survived with a probability. rays: of the
  /// offset paths; nullopt outside the image.
  void add(ExpectedSample& sample, const ExplicitPath& path, int t, double survival,
           const std::array<std::optional<Ray>, kNeighbours.size()>& rays) {
    const double density = path.density(t), sampled = density * path.choices(t) * survival;
    const Value f = path.contribution();
    if (!(density > 0) || !(f.maxCoeff() > 0)) return;
    sample.radiance.add(f * (squared(density) / sumOfSquares(path, techniques_) / sampled));
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const auto offset = rays[i] ? shift_(path, *rays[i], t) : std::nullopt;
      addDifference(sample.differences[i], path, t, sampled, offset);
    }
  }

 private:
  void addDifference(Sum& sum, const ExplicitPath& path, int t, double sampled,
                     const std::optional<ShiftedExplicitPath>& offset) {
    const Value f = path.contribution();
    const double density = path.density(t), total = sumOfSquares(path, techniques_);
    const Value g = offset ? Value(offset->path.contribution() * offset->jacobian) : Value::Zero();
    double group = 0, offsetGroup = 0;
    if (offset) {
      group = offset->own ? squared(density) : sumOfSquares(path, techniques_, offset->first);
      offsetGroup =
          offset->own ? squared(offset->path.density(t)) : sumOfSquares(offset->path, techniques_, offset->first);
    }
    if (!(g.maxCoeff() > 0) || !(offsetGroup > 0)) return sum.add(f * (squared(density) / total / sampled));
    // Of the pixels, the group estimates the part that its multiple importance weights leave.
    const double part = group / total, offsetPart = offsetGroup / sumOfSquares(offset->path, techniques_);
    const double ratio = offset->jacobian * probability(offset->path, t) / probability(path, t);
    const double weight = squared(density) / (group + offsetGroup * squared(ratio));
    sum.add(f * (weight * part / sampled));
    sum.add(g * (-weight * offsetPart / sampled));
    ++coverage_.pairs[path.size() - 1][t];
    checkReturn(path, t, *offset);
  }

  // The shift from the offset path leads back, in the same group of techniques: so the weights of both directions sum
  // to one.
  void checkReturn(const ExplicitPath& path, int t, const ShiftedExplicitPath& offset) {
    const auto back = shift_(offset.path, path.ray(), t);
    ++coverage_.shifts;
    const bool inverse = back && back->first == offset.first && back->own == offset.own &&
                         std::abs(back->jacobian * offset.jacobian - 1) < 0.01;
    if (!inverse) ++coverage_.irreversible;
  }

  // What densities of techniques have in common. Bidirectional paths leave out Russian roulette.
  double probability(const ExplicitPath& path, int t) const {
    return path.choices(t) * (techniques_ == Techniques::camera ? path.survival(t, options_.rouletteDepth) : 1.0);
  }

  const PathOptions& options_;
  Techniques techniques_;
  Shift shift_;
  Coverage& coverage_;
};

class WeightsTest {
 public:
  WeightsTest(const std::string& body, std::optional<Environment> environment, int rouletteDepth)
      : scene_(sceneOf(body, std::move(environment))), ready_(scene_), camera_(scene_.camera, scene_.filter) {
    options_.maxDepth = 6, options_.rouletteDepth = rouletteDepth;
  }

  Coverage run(Techniques techniques, int samples) {
    for (int y = 0; y < camera_.height(); ++y)
      for (int x = 0; x < camera_.width(); ++x)
        for (int s = 0; s < samples; ++s) compare(techniques, x, y, s);
    return coverage_;
  }

 private:
  static constexpr const char* kCamera = R"(<sensor type="perspective"><float name="fov" value="45"/>
    <transform name="to_world"><lookat origin="0, -3.5, 1.6" target="0, 0, 0.8" up="0, 0, 1"/></transform>
    <film type="hdrfilm"><integer name="width" value="6"/><integer name="height" value="5"/>
    <rfilter type="box"/></film></sensor>)";

  static Scene sceneOf(const std::string& body, std::optional<Environment> environment) {
    Scene scene = readText("<scene version=\"3.0.0\">" + body + kCamera + "</scene>");
    scene.environment = std::move(environment);
    return scene;
  }

  void compare(Techniques techniques, int x, int y, int index) {
    const auto pixel = static_cast<std::uint64_t>(y) * camera_.width() + x;
    Sampler rng = Sampler::stratified(1, pixel, static_cast<std::uint32_t>(index));
    Sampler lightRng(2, pixel, static_cast<std::uint64_t>(index));
    Sampler rngAgain = rng, lightRngAgain = lightRng;
    const BsdfSampler sampler;
    PathStatistics statistics;
    const GradientContext<BsdfSampler> context{ready_, camera_, options_, sampler};
    Oracle oracle(ready_, camera_, options_, techniques, coverage_);
    if (techniques == Techniques::camera)
      return judge(GradientPath(context, rng, statistics).trace(x, y), ofCamera(oracle, x, y, {}, rngAgain));
    GradientSplatLists lists;
    for (auto& list : lists) list.assign(1, {});
    const GradientSample sample =
        GradientBidirectionalPath(context, sampler, rng, statistics).trace(x, y, lightRng, GradientSplats(lists, 0));
    const Subpath light = SubpathTracer(ready_, camera_, options_).fromLight(lightRngAgain);
    judge(sample, ofCamera(oracle, x, y, light, rngAgain));
    const std::vector<ExpectedSample> splats = ofLight(oracle, light);
    REQUIRE(lists[0][0].size() == splats.size());
    for (std::size_t i = 0; i < splats.size(); ++i) {
      GradientSample splat{lists[0][0][i].value};
      for (std::size_t d = 0; d < kNeighbours.size(); ++d) splat.differences[d] = lists[1 + d][0][i].value;
      judge(splat, splats[i]);
    }
  }

  void judge(const GradientSample& sample, const ExpectedSample& expected) {
    if (!(expected.radiance.value.maxCoeff() > 0) && !(sample.radiance.maxCoeff() > 0)) return;
    bool equal = expected.radiance.equals(sample.radiance);
    for (std::size_t d = 0; d < kNeighbours.size(); ++d)
      equal = equal && expected.differences[d].equals(sample.differences[d]);
    ++coverage_.samples;
    if (equal) return;
    ++coverage_.failed;
    std::ostringstream text;
    text << "radiance " << sample.radiance.transpose() << ", expected " << expected.radiance.value.transpose();
    for (std::size_t d = 0; d < kNeighbours.size(); ++d)
      if (!expected.differences[d].equals(sample.differences[d]))
        text << "; difference " << d << ' ' << sample.differences[d].transpose() << ", expected "
             << expected.differences[d].value.transpose();
    coverage_.lastFailure = text.str();
  }

  static Ray unbounded(const Ray& ray) { return {ray.origin, ray.direction}; }

  static PathVertex smooth(const Subpath::Vertex& vertex) { return {*vertex.hit}; }
  static PathVertex continued(const Subpath::Vertex& vertex) { return {*vertex.hit, vertex.delta, vertex.eta}; }

  // The vertices of a light path from vertex j on towards its origin.
  static void append(std::vector<PathVertex>& vertices, const Subpath& light, int j) {
    vertices.push_back(smooth(light.vertices[j]));
    while (--j >= 0) vertices.push_back(continued(light.vertices[j]));
  }

  std::vector<ExpectedSample> ofLight(Oracle& oracle, const Subpath& light) const {
    std::vector<ExpectedSample> splats;
    for (int j = 0; j < static_cast<int>(light.vertices.size()); ++j) {
      if (!light.vertices[j].scatters) continue;
      const SurfaceHit& hit = *light.vertices[j].hit;
      const auto view = camera_.view(hit.position, light.lens);
      if (!view || !ready_.visibleToCamera(hit, view->ray, EmitterVisibility::shown)) continue;
      std::array<std::optional<Ray>, kNeighbours.size()> rays;
      for (std::size_t d = 0; d < rays.size(); ++d)
        rays[d] = camera_.rayThrough(view->film + Vec2(kNeighbours[d][0], kNeighbours[d][1]), light.lens);
      std::vector<PathVertex> vertices;
      append(vertices, light, j);
      const ExplicitPath path(ready_, camera_, unbounded(view->ray), vertices, light.origin);
      if (!(path.contribution().maxCoeff() > 0)) continue;
      oracle.add(splats.emplace_back(), path, 0, light.vertices[j].survival, rays);
    }
    return splats;
  }

  ExpectedSample ofCamera(Oracle& oracle, int x, int y, const Subpath& light, Sampler& rng) const {
    const CameraSample place = camera_.sample(rng);
    const Ray ray = camera_.rayThrough(x, y, place);
    std::array<std::optional<Ray>, kNeighbours.size()> rays;
    for (std::size_t d = 0; d < rays.size(); ++d) {
      const int nextX = x + kNeighbours[d][0], nextY = y + kNeighbours[d][1];
      if (nextX >= 0 && nextY >= 0 && nextX < camera_.width() && nextY < camera_.height())
        rays[d] = camera_.rayThrough(nextX, nextY, place);
    }
    ExpectedSample sample;
    const Subpath path = SubpathTracer(ready_, camera_, options_).fromCamera(ray, rng);
    std::vector<PathVertex> before;
    for (int k = 0; k < static_cast<int>(path.vertices.size()); ++k) {
      const Subpath::Vertex& vertex = path.vertices[k];
      const double survival = k > 0 ? path.vertices[k - 1].survival : 1;
      if (k > 0 && (!vertex.hit || vertex.hit->emitter)) {
        const LightOrigin origin{vertex.hit, vertex.direction, -1};
        oracle.add(sample, ExplicitPath(ready_, camera_, ray, before, origin), k + 1, survival, rays);
      }
      if (!vertex.hit) break;
      if (vertex.scatters) addConnections(oracle, sample, ray, rays, before, vertex, light);
      before.push_back(continued(vertex));
    }
    return sample;
  }

  void addConnections(Oracle& oracle, ExpectedSample& sample, const Ray& ray,
                      const std::array<std::optional<Ray>, kNeighbours.size()>& rays, std::vector<PathVertex> before,
                      const Subpath::Vertex& vertex, const Subpath& light) const {
    before.push_back(smooth(vertex));
    const int t = static_cast<int>(before.size());
    if (vertex.light) {
      const ExplicitPath path(ready_, camera_, ray, before, originOf(*vertex.hit, *vertex.light));
      if (path.visible(t - 1)) oracle.add(sample, path, t, vertex.survival, rays);
    }
    for (int j = 0; j < static_cast<int>(light.vertices.size()) && t + j + 1 < options_.maxDepth; ++j) {
      if (!light.vertices[j].scatters) continue;
      std::vector<PathVertex> all = before;
      append(all, light, j);
      const ExplicitPath path(ready_, camera_, ray, all, light.origin);
      if (path.visible(t - 1)) oracle.add(sample, path, t, vertex.survival * light.vertices[j].survival, rays);
    }
  }

  LightOrigin originOf(const SurfaceHit& hit, const LightSample& light) const {
    if (light.delta) return {std::nullopt, Vec3::Zero(), light.light};
    if (light.light < 0) return {std::nullopt, light.wi, -1};
    return {ready_.tracer.trace(spawnRay(hit, light.wi)), Vec3::Zero(), -1};
  }

  Scene scene_;
  RenderScene ready_;
  RayCamera camera_;
  PathOptions options_;
  Coverage coverage_;
};

/// A room that is open towards the camera, of walls with different colours.
constexpr const char* kRoom = R"(
  <bsdf type="twosided" id="floor"><bsdf type="diffuse"><texture type="checkerboard" name="reflectance">
    <float name="uscale" value="5"/><float name="vscale" value="5"/><rgb name="color0" value="0.9, 0.5, 0.2"/>
    <rgb name="color1" value="0.2, 0.6, 0.8"/></texture></bsdf></bsdf>
  <bsdf type="twosided" id="wall"><bsdf type="diffuse"><rgb name="reflectance" value="0.3, 0.7, 0.5"/></bsdf></bsdf>
  <shape type="rectangle"><transform name="to_world"><scale value="1.5"/></transform><ref id="floor"/></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="1.5"/><rotate y="1" angle="80"/>
    <translate x="-1.2" z="1"/></transform><ref id="wall"/></shape>)";

constexpr const char* kBackWall = R"(
  <shape type="rectangle"><transform name="to_world"><scale value="1.5"/><rotate x="1" angle="100"/>
    <translate y="1.2" z="1"/></transform>)";

constexpr const char* kLamp = R"(<shape type="rectangle"><transform name="to_world"><scale value="0.9"/>
    <rotate x="1" angle="165"/><translate x="0.3" y="-0.2" z="2.1"/></transform>
    <emitter type="area"><rgb name="radiance" value="9, 8, 7"/></emitter><ref id="wall"/></shape>)";

/// The direction of a brighter part is to the upper left.
Environment sky() {
  Image image(16, 8);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x)
      image.at(x, y) =
          Rgb(0.4f, 0.5f, 0.6f) * (0.3f + 3 * std::exp(-0.1f * static_cast<float>((x - 4) * (x - 4) + y * y)));
  Eigen::Matrix3f toWorld;
  toWorld << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  return {std::move(image), toWorld};
}

constexpr const char* kRough = R"(<bsdf type="twosided"><bsdf type="roughplastic"><float name="alpha" value="0.3"/>
    <rgb name="diffuse_reflectance" value="0.6, 0.3, 0.5"/></bsdf></bsdf></shape>)";

void checkAgreement(const Coverage& coverage) {
  CAPTURE(coverage.samples, coverage.failed, coverage.lastFailure, coverage.irreversible);
  CHECK(coverage.samples > 500);
  CHECK(coverage.failed <= 0.001 * coverage.samples);
  CHECK(coverage.irreversible <= 0.001 * coverage.shifts);
}

}  // namespace

TEST_CASE("gradients: the weights are those of explicit densities") {
  const auto [name, body] =
      GENERATE(table<std::string, std::string>({{"area light", std::string(kLamp) + kBackWall + kRough},
                                                {"environment", std::string(kBackWall) + kRough},
                                                {"point and distant light", std::string(R"(<emitter type="directional">
          <vector name="direction" x="1" y="1" z="-2"/><rgb name="irradiance" value="1, 1, 1"/></emitter>
          <emitter type="point"><point name="position" x="1" y="-1" z="2.5"/><rgb name="intensity" value="6, 5, 4"/>
          </emitter>)") + kBackWall + kRough}}));
  const int rouletteDepth = GENERATE(5, 1);
  const Techniques techniques = GENERATE(Techniques::camera, Techniques::bidirectional);
  CAPTURE(name, rouletteDepth, techniques == Techniques::camera);
  const auto environment = name == "environment" ? std::optional(sky()) : std::nullopt;
  const Coverage coverage = WeightsTest(kRoom + body, environment, rouletteDepth).run(techniques, 60);
  checkAgreement(coverage);
  for (int n = 1; n <= 4; ++n)
    for (int t = techniques == Techniques::camera ? n : 0; t <= n + 1; ++t) {
      CAPTURE(n, t);
      if (name != "point and distant light" || t <= n) CHECK(coverage.pairs[n - 1][t] > 5);
    }
}

TEST_CASE("gradients: the weights at specular and glossy surfaces are those of explicit densities") {
  const auto [name, body, lit] = GENERATE(table<std::string, std::string, bool>(
      {{"nearly smooth metal", std::string(kLamp) + kBackWall + R"(<bsdf type="twosided">
          <bsdf type="roughconductor"><float name="alpha" value="0.012"/></bsdf></bsdf></shape>)",
        true},
       {"plastic", std::string(kLamp) + kBackWall + R"(<bsdf type="twosided"><bsdf type="plastic">
          <rgb name="diffuse_reflectance" value="0.6, 0.3, 0.5"/></bsdf></bsdf></shape>)",
        true},
       {"mirror", std::string(kLamp) + kBackWall + R"(<bsdf type="twosided"><bsdf type="conductor"/></bsdf></shape>)",
        true},
       {"nearly smooth glass", std::string(kLamp) + kBackWall + kRough + R"(<shape type="rectangle">
          <transform name="to_world"><scale value="0.8"/><rotate x="1" angle="80"/><translate y="-1" z="0.9"/></transform>
          <bsdf type="roughdielectric"><float name="alpha" value="0.012"/></bsdf></shape>)",
        true},
       {"frosted glass", std::string(kLamp) + kBackWall + kRough + R"(<shape type="rectangle">
          <transform name="to_world"><scale value="0.8"/><rotate x="1" angle="80"/><translate y="-1" z="0.9"/></transform>
          <bsdf type="roughdielectric"><float name="alpha" value="0.3"/></bsdf></shape>)",
        true},
       // The rear of a blend of glass and metal, where the metal has no sample.
       {"glass and metal seen from behind", std::string(kLamp) + kBackWall + kRough + R"(<shape type="rectangle">
          <transform name="to_world"><scale value="0.8"/><rotate x="1" angle="-100"/><translate y="-1" z="0.9"/></transform>
          <bsdf type="blendbsdf"><texture type="checkerboard" name="weight"><float name="uscale" value="5"/>
          <float name="vscale" value="5"/><rgb name="color0" value="0.2"/><rgb name="color1" value="0.8"/></texture>
          <bsdf type="dielectric"/><bsdf type="conductor"/></bsdf></shape>)",
        false},
       // Camera and walls are in glass, and the light is outside.
       {"refracted light", std::string(kBackWall) + kRough + R"(<shape type="rectangle"><transform name="to_world">
          <scale value="6"/><rotate x="1" angle="3"/><translate z="2.2"/></transform><bsdf type="dielectric"/></shape>
          <shape type="rectangle"><transform name="to_world"><scale value="2"/><rotate x="1" angle="180"/>
          <translate z="3"/></transform><emitter type="area"><rgb name="radiance" value="9, 8, 7"/></emitter></shape>)",
        false},
       // Next-event estimation is as dense as the reflection.
       {"small lamp reflected in nearly smooth metal", std::string(kBackWall) + R"(<bsdf type="twosided">
          <bsdf type="roughconductor"><float name="alpha" value="0.012"/></bsdf></bsdf></shape>
          <shape type="sphere"><point name="center" x="0.5" y="-3.6" z="0.45"/><float name="radius" value="0.15"/>
          <emitter type="area"><rgb name="radiance" value="90, 80, 70"/></emitter></shape>)",
        false},
       {"mapped normals", std::string(kLamp) + kBackWall + R"(<bsdf type="twosided"><bsdf type="normalmap">
          <texture type="checkerboard"><float name="uscale" value="3"/><float name="vscale" value="3"/>
          <rgb name="color0" value="0.95, 0.5, 0.7"/><rgb name="color1" value="0.2, 0.9, 0.7"/></texture>
          <bsdf type="plastic"><rgb name="diffuse_reflectance" value="0.6, 0.3, 0.5"/></bsdf></bsdf></bsdf></shape>)",
        true},
       // A specular reflection that light does not take in the other direction.
       {"normals turned towards the viewer",
        std::string(kLamp) + kBackWall + kRough + R"(<shape type="rectangle"><transform name="to_world">
          <scale value="1.1"/><translate z="0.05"/></transform><bsdf type="normalmap"><texture type="checkerboard">
          <float name="uscale" value="3"/><float name="vscale" value="3"/>
          <rgb name="color0" value="0.5, 0.8, 0.9"/><rgb name="color1" value="0.5, 0.2, 0.9"/></texture>
          <boolean name="flip_invalid_normals" value="true"/><bsdf type="plastic">
          <rgb name="diffuse_reflectance" value="0.6, 0.3, 0.5"/></bsdf></bsdf></shape>)",
        true}}));
  const Techniques techniques = GENERATE(Techniques::camera, Techniques::bidirectional);
  CAPTURE(name, techniques == Techniques::camera);
  if (techniques == Techniques::camera && name == "refracted light")
    return;  // next-event estimation passes the surface
  const auto environment = lit ? std::optional(sky()) : std::nullopt;
  const Coverage coverage = WeightsTest(kRoom + body, environment, 5).run(techniques, 60);
  checkAgreement(coverage);
}
