// lobebench-vertices: the relative variance (NEV) of one sample of ∫ f |cosθ| L dω, f the BSDF, for each density from
// which paths sample directions, at random vertices of camera paths.

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <functional>
#include <numbers>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <oneapi/tbb/global_control.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "runtime/analysis/incident_radiance.h"
#include "runtime/bench/bench_training.h"
#include "runtime/core/parallel.h"
#include "runtime/core/sampling.h"
#include "runtime/core/statistics.h"
#include "runtime/guiding/field_data.h"
#include "runtime/render/training/visible_region.h"
#include "runtime/tools/json_text.h"
#include "runtime/tools/option_names.h"

namespace {

using namespace lobe;

// Seed of vertices and their incident radiance, different from that of training.
constexpr std::uint64_t kVertexSeed = 1000003;
constexpr int kPathsPerVertex = 100;  // upper bound of the paths traced to find a vertex

struct Options : BenchTraining {
  std::string cacheFolder = "lobes";
  int vertices = 1000;
  int directions = 1280;  ///< per vertex
  int paths = 4;          ///< per estimate; each direction has two estimates
  std::vector<double> reductions{0.02f, 0.05f, 0.1f, 0.2f, 0.5f, 1, 2};
};

/// Samples like the wrapped sampler and collects the vertices of the path.
struct CollectingSampler {
  const GuidedSampler& within;
  std::vector<SurfaceHit>& vertices;

  class Vertex : public GuidedSampler::Vertex {
   public:
    Vertex(const CollectingSampler& sampler, const SurfaceHit& hit) : GuidedSampler::Vertex(sampler.within, hit) {
      sampler.vertices.push_back(hit);
    }
  };
};

/// Random vertices of camera paths: one from each path, chosen uniformly among its vertices.
std::vector<SurfaceHit> verticesOfPaths(const RenderScene& scene, const RayCamera& camera, const GuidedSampler& sampler,
                                        int count) {
  std::vector<SurfaceHit> chosen;
  PathStatistics statistics;
  const PathOptions options;
  for (int i = 0; i < kPathsPerVertex * count && static_cast<int>(chosen.size()) < count; ++i) {
    Sampler rng(kVertexSeed, 0, i);
    const Vec2 pixel = rng.uniform2();
    const Ray ray = camera.sample(static_cast<int>(pixel.x() * static_cast<float>(camera.width())),
                                  static_cast<int>(pixel.y() * static_cast<float>(camera.height())), rng);
    std::vector<SurfaceHit> vertices;
    const CollectingSampler collecting{sampler, vertices};
    PathLoop(scene, options, collecting).radiance(ray, rng, statistics);
    if (vertices.empty()) continue;
    chosen.push_back(vertices[static_cast<std::size_t>(rng.uniform() * static_cast<float>(vertices.size()))]);
  }
  return chosen;
}

/// The mixtures of both factors, reduced with a threshold on the cost of merging.
struct ReducedFactors {
  ReducedFactors(const Options& o, const Scene& scene, const Field& trained, double cost)
      : threshold(cost),
        illumination(cost > 0 ? trained.reduced(static_cast<float>(cost)) : trained),
        caches(o.cacheFolder, lobeRequests(scene), fmt::format("lobefit {} -o {}", o.scene, o.cacheFolder),
               static_cast<float>(cost)),
        sampler(scene, illumination, &caches) {}
  ReducedFactors(const ReducedFactors&) = delete;
  ReducedFactors& operator=(const ReducedFactors&) = delete;

  double threshold;
  Field illumination;
  LobeCacheSet caches;
  GuidedSampler sampler;
};

/// The records without their learnt BSDF sampling fractions.
Field withFixedFractions(const Field& field) {
  std::vector<IlluminationRecord> records = cacheOf(field).records();
  for (IlluminationRecord& r : records) r.bsdfFraction = kProductProbabilities.bsdf;
  return fieldOf({records, cacheOf(field).unit()});
}

/// Everything that is needed to grade vertices.
struct Bench {
  const RenderScene& scene;
  const Integrator& paths;
  const GuidedSampler& guided;
  const GuidedSampler& product;
  const GuidedSampler& fixedFractions;
  const Options& options;
};

/// Estimates f |cosθ| L at a vertex. Equal numbers of directions are sampled from the BSDF, both guided densities, the
/// uniform density and the environment, and are combined with the balance heuristic.
class DirectionSampler {
 public:
  DirectionSampler(const Bench& bench, const SurfaceHit& hit, std::uint64_t stream)
      : bench_(bench),
        hit_(hit),
        guided_(bench.guided, hit),
        product_(bench.product, hit),
        rng_(kVertexSeed, 1, stream) {}

  IncidentRadiance run() {
    const int strategies = environment() ? 5 : 4;
    each_ = bench_.options.directions / strategies / 2 * 2;
    for (int strategy = 0; strategy < strategies; ++strategy)
      for (int i = 0; i < each_; ++i)
        if (const std::optional<Vec3> wi = draw(strategy)) addSample(*wi, i % 2 == 0);
    return IncidentRadiance(std::move(samples_));
  }

 private:
  const EnvironmentLight* environment() const { return bench_.scene.lights.environment(); }

  std::optional<Vec3> draw(int strategy) {
    const auto direction = [](const std::optional<BsdfSample>& s) { return s ? std::optional(s->wi) : std::nullopt; };
    const float choice = rng_.uniform();
    switch (strategy) {
      case 0:
        return direction(sampleBsdf(hit_, choice, rng_.uniform2()));
      case 1:
        return direction(guided_.sample(rng_, statistics_));
      case 2:
        return direction(product_.sample(rng_, statistics_));
      case 3:
        return squareToSphere(rng_.uniform2());
      default: {
        const auto sample = environment()->sample(rng_.uniform2());
        return sample ? std::optional(hit_.frame.toLocal(sample->wi)) : std::nullopt;
      }
    }
  }

  double density(const Vec3& local, const Vec3& world) const {
    constexpr double uniform = 0.25 * std::numbers::inv_pi;
    const double all = static_cast<double>(hit_.bsdf->pdf(hit_.wo, local, hit_.uv)) + guided_.pdf(local) +
                       product_.pdf(local) + uniform + (environment() ? environment()->pdf(world) : 0.0f);
    return each_ * all;
  }

  void addSample(const Vec3& local, bool firstHalf) {
    const Vec3 world = hit_.frame.toWorld(local).normalized();
    if (!sidesAgree(hit_, world, local)) return;
    const Rgb f = evalBsdf(hit_, local) * std::abs(local.z());
    if (!(f.maxCoeff() > 0)) return;
    const Receiver receiver{hit_, std::copysign(1.0f, hit_.normal.dot(world)) * hit_.normal};
    const Ray ray = spawnRay(hit_, world);
    const Rgb leftToNee = emissionLeftToNee(bench_.scene, receiver, ray);
    const double first = estimate(f, ray, leftToNee), second = estimate(f, ray, leftToNee);
    samples_.push_back({local, density(local, world), first, second, firstHalf});
  }

  double estimate(const Rgb& f, const Ray& ray, const Rgb& leftToNee) {
    double sum = 0;
    for (int i = 0; i < bench_.options.paths; ++i) {
      const float value = luminance(Rgb(f * (bench_.paths.radiance(ray, rng_, statistics_) - leftToNee)));
      if (std::isfinite(value)) sum += std::max(0.0f, value);
    }
    return sum / bench_.options.paths;
  }

  const Bench& bench_;
  const SurfaceHit& hit_;
  GuidedSampler::Vertex guided_, product_;
  Sampler rng_;
  PathStatistics statistics_;
  int each_ = 0;
  std::vector<IncidentRadiance::Sample> samples_;
};

/// The minimiser of a convex function in [low, high], by golden-section search.
double leastAt(const std::function<double(double)>& function, double low, double high) {
  constexpr double golden = 0.6180339887498949;
  double left = high - golden * (high - low), right = low + golden * (high - low);
  double atLeft = function(left), atRight = function(right);
  for (int i = 0; i < 24; ++i) {
    if (atLeft < atRight) {
      high = right, right = left, atRight = atLeft;
      left = high - golden * (high - low), atLeft = function(left);
    } else {
      low = left, left = right, atLeft = atRight;
      right = low + golden * (high - low), atRight = function(right);
    }
  }
  return 0.5 * (low + high);
}

/// The densities whose relative variances are reported, before those of reduced mixtures. For the product, the BSDF
/// sampling fraction is the one that its records have learnt, a fixed one for all records, or the best one for each
/// vertex, by Kullback–Leibler divergence or by relative variance.
constexpr std::array kDensityNames{
    "bsdf", "guided", "product", "product_fixed_fractions", "product_fraction_by_kl", "product_fraction_by_nev"};

/// The results at one vertex.
struct Grade {
  GuidingDecision decision = GuidingDecision::noRecord;
  std::vector<double> nevs;  ///< of kDensityNames, then of each reduction; empty: no light was found
  double fraction = 1;       ///< BSDF sampling fraction of the product's density
  double bestFraction = 1;   ///< the fraction with the least relative variance
};

/// The product's density with other BSDF sampling fractions.
class ProductWithFraction {
 public:
  ProductWithFraction(const GuidedSampler::Vertex& product, const SurfaceHit& hit, const IncidentRadiance& light)
      : product_(product), hit_(hit), light_(light) {}

  double pdf(const Vec3& wi, double fraction) const {
    const double own = product_.distribution().bsdfProbability(), bsdf = hit_.bsdf->pdf(hit_.wo, wi, hit_.uv);
    return fraction * bsdf + (1 - fraction) * std::max(0.0, product_.pdf(wi) - own * bsdf) / (1 - own);
  }
  std::optional<double> nev(double fraction) const {
    return light_.nev([&](const Vec3& wi) { return pdf(wi, fraction); });
  }
  double fractionByNev() const {
    return best([&](double fraction) { return *nev(fraction); });
  }
  double fractionByKl() const {
    return best([&](double fraction) {
      double sum = 0;
      for (const IncidentRadiance::Sample& s : light_.samples())
        sum -= (s.first + s.second) / s.density * std::log(pdf(s.wi, fraction));
      return sum;
    });
  }

 private:
  /// The fraction must not be 0, or the density could vanish where the BSDF does not.
  static double best(const std::function<double(double)>& loss) { return leastAt(loss, 0.02, 1); }

  const GuidedSampler::Vertex& product_;
  const SurfaceHit& hit_;
  const IncidentRadiance& light_;
};

Grade gradeVertex(const Bench& bench, const std::deque<ReducedFactors>& reductions, const SurfaceHit& hit,
                  std::uint64_t stream) {
  const IncidentRadiance light = DirectionSampler(bench, hit, stream).run();
  const auto nev = [&](const GuidedSampler& sampler) {
    const GuidedSampler::Vertex vertex(sampler, hit);
    return light.nev([&](const Vec3& wi) { return vertex.pdf(wi); });
  };
  const GuidedSampler::Vertex product(bench.product, hit);
  Grade grade{.decision = product.distribution().decision(),
              .nevs = {},
              .fraction = product.distribution().bsdfProbability(),
              .bestFraction = 1};
  const auto bsdf = light.nev([&](const Vec3& wi) { return hit.bsdf->pdf(hit.wo, wi, hit.uv); });
  if (!bsdf) return grade;
  grade.nevs = {*bsdf, *nev(bench.guided), *nev(bench.product), *nev(bench.fixedFractions)};
  if (grade.fraction < 1) {
    const ProductWithFraction withFraction(product, hit, light);
    grade.bestFraction = withFraction.fractionByNev();
    grade.nevs.push_back(*withFraction.nev(withFraction.fractionByKl()));
    grade.nevs.push_back(*withFraction.nev(grade.bestFraction));
  } else {
    grade.nevs.insert(grade.nevs.end(), 2, grade.nevs[2]);
  }
  for (const ReducedFactors& r : reductions) grade.nevs.push_back(*nev(r.sampler));
  return grade;
}

std::vector<Grade> gradeAll(const Bench& bench, const std::deque<ReducedFactors>& reductions,
                            const std::vector<SurfaceHit>& vertices) {
  std::vector<Grade> grades(vertices.size());
  Progress progress("vertices", static_cast<double>(vertices.size()));
  parallelFor(std::size_t{0}, vertices.size(), [&](std::size_t i) {
    grades[i] = gradeVertex(bench, reductions, vertices[i], i);
    progress.advance();
  });
  return grades;
}

/// Statistics of the density with this index in Grade::nevs, over the vertices that receive light.
nlohmann::ordered_json summary(const std::vector<Grade>& grades, std::size_t density) {
  std::vector<double> nevs;
  for (const Grade& g : grades)
    if (!g.nevs.empty()) nevs.push_back(g.nevs[density]);
  if (nevs.empty()) return nullptr;
  std::ranges::sort(nevs);
  return {{"median", quantile(nevs, 0.5)}, {"p90", quantile(nevs, 0.9)}, {"p99", quantile(nevs, 0.99)}};
}

nlohmann::ordered_json decisionCounts(const std::vector<Grade>& grades) {
  std::array<int, kGuidingDecisionNames.size()> counts{};
  for (const Grade& g : grades) ++counts[static_cast<std::size_t>(g.decision)];
  nlohmann::ordered_json json;
  for (std::size_t i = 0; i < counts.size(); ++i) json[kGuidingDecisionNames[i]] = counts[i];
  return json;
}

nlohmann::ordered_json report(const std::vector<Grade>& grades, const std::deque<ReducedFactors>& reductions) {
  const auto lit = std::ranges::count_if(grades, [](const Grade& g) { return !g.nevs.empty(); });
  const auto above =
      std::ranges::count_if(grades, [](const Grade& g) { return !g.nevs.empty() && g.nevs[2] > g.nevs[1]; });
  nlohmann::ordered_json json{{"vertices", grades.size()}, {"lit", lit}, {"decisions", decisionCounts(grades)}};
  for (std::size_t i = 0; i < kDensityNames.size(); ++i) json["nev"][kDensityNames[i]] = summary(grades, i);
  json["product_above_guided_fraction"] =
      static_cast<double>(above) / static_cast<double>(std::max<std::ptrdiff_t>(lit, 1));
  json["reduction"] = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < reductions.size(); ++i) {
    nlohmann::ordered_json row{{"threshold", reductions[i].threshold},
                               {"record_components", reductions[i].illumination.meanComponents()},
                               {"lobe_components", reductions[i].caches.meanComponents()}};
    row["nev"] = summary(grades, kDensityNames.size() + i);
    json["reduction"].push_back(row);
  }
  return json;
}

void run(Options& o) {
  std::optional<oneapi::tbb::global_control> limit;
  if (o.threads > 0) limit.emplace(oneapi::tbb::global_control::max_allowed_parallelism, o.threads);
  o.plan.validate();
  const Scene scene = o.readScene();
  RenderScene renderScene(scene);
  const RayCamera camera(scene.camera, scene.filter);
  renderScene.lights.focus(visibleRegion(renderScene, camera, o.plan.seed, o.plan.maxDepth));
  const LobeCacheSet caches(o.cacheFolder, lobeRequests(scene),
                            fmt::format("lobefit {} -o {}", o.scene, o.cacheFolder));
  const TrainedIllumination trained = trainIllumination(renderScene, camera, &caches, o.plan);
  std::deque<ReducedFactors> reductions;
  for (const double threshold : o.reductions) reductions.emplace_back(o, scene, trained.field, threshold);
  const GuidedSampler guided(scene, trained.field, nullptr), product(scene, trained.field, &caches);
  const Field withoutFractions = withFixedFractions(trained.field);
  const GuidedSampler fixedFractions(scene, withoutFractions, &caches);
  const GuidedIntegrator paths(renderScene, {}, product);
  const std::vector<SurfaceHit> vertices = verticesOfPaths(renderScene, camera, product, o.vertices);
  const Bench bench{renderScene, paths, guided, product, fixedFractions, o};
  fmt::print("{}\n", jsonText(report(gradeAll(bench, reductions, vertices), reductions)));
}

void declare(CLI::App& app, Options& o) {
  o.declare(app);
  app.add_option("--cache", o.cacheFolder, "Folder of the caches written by lobefit")->capture_default_str();
  app.add_option("--train", o.plan.from, "Source of the training samples: photons, camera paths or both")
      ->transform(CLI::CheckedTransformer(trainFromNames()))
      ->default_str("both");
  app.add_option("--passes", o.plan.passes, "Number of training passes")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--vertices", o.vertices, "Number of path vertices to grade")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--directions", o.directions, "Number of sampled directions per vertex")
      ->check(CLI::Range(16, 1 << 20))
      ->capture_default_str();
  app.add_option("--paths", o.paths,
                 "Paths per estimate, with two estimates per direction; more paths find more of the rare light")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--reductions", o.reductions, "Thresholds on the cost of merging Gaussians, separated by commas")
      ->delimiter(',')
      ->check(fromTo(0, 1e6))
      ->capture_default_str();
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  return lobe::runTool(
      "lobebench-vertices",
      "Trains a scene and measures, at random vertices of camera paths, the relative variance (NEV) of one sample of "
      "BSDF times cosine times incident radiance for several densities of directions; prints JSON. Direct light from "
      "an emitter is weighted as multiple importance sampling weights cosine-weighted directions.",
      argc, argv, [&](CLI::App& app) { declare(app, options); }, [&] { run(options); });
}
