// lobebench-vertices: how well the densities that paths choose directions by fit what they are to integrate, at random
// vertices of the camera's paths: the variance of one sample of ∫ f |cosθ| L dω, f the BSDF, by each density.

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
#include <nlohmann/json.hpp>

#include "runtime/analysis/incident_radiance.h"
#include "runtime/bench/bench_training.h"
#include "runtime/core/parallel.h"
#include "runtime/core/sampling.h"
#include "runtime/core/statistics.h"
#include "runtime/guiding/field_data.h"

namespace {

using namespace lobe;

// Of vertices and the light they receive; not of training.
constexpr std::uint64_t kVertexSeed = 1000003;
constexpr int kPathsPerVertex = 100;  // until it is given up to find more

struct Options : BenchTraining {
  std::string cacheFolder = "lobes";
  int vertices = 1000;
  int directions = 1280;  ///< at each
  int paths = 4;          ///< along each direction, twice
  std::vector<double> reductions{0.02f, 0.05f, 0.1f, 0.2f, 0.5f, 1, 2};
};

/// Samples as the sampler within does, and notes where.
struct NotingSampler {
  const GuidedSampler& within;
  std::vector<SurfaceHit>& vertices;

  class Vertex : public GuidedSampler::Vertex {
   public:
    Vertex(const NotingSampler& sampler, const SurfaceHit& hit) : GuidedSampler::Vertex(sampler.within, hit) {
      sampler.vertices.push_back(hit);
    }
  };
};

/// One vertex, any of them alike, from each of as many paths of the camera as it takes.
std::vector<SurfaceHit> verticesOfPaths(const RenderScene& scene, const RayCamera& camera, const GuidedSampler& sampler,
                                        int count) {
  std::vector<SurfaceHit> chosen;
  PathStatistics statistics;
  const PathOptions options;
  for (int i = 0; i < kPathsPerVertex * count && static_cast<int>(chosen.size()) < count; ++i) {
    Rng rng(kVertexSeed, 0, i);
    const Vec2 pixel = rng.uniform2();
    const Ray ray = camera.sample(static_cast<int>(pixel.x() * static_cast<float>(camera.width())),
                                  static_cast<int>(pixel.y() * static_cast<float>(camera.height())), rng);
    std::vector<SurfaceHit> vertices;
    const NotingSampler noting{sampler, vertices};
    PathLoop(scene, options, noting).radiance(ray, rng, statistics);
    if (vertices.empty()) continue;
    chosen.push_back(vertices[static_cast<std::size_t>(rng.uniform() * static_cast<float>(vertices.size()))]);
  }
  return chosen;
}

/// Mixtures of both factors, merged up to a cost.
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

/// The records without the shares that they have learnt.
Field withFixedFractions(const Field& field) {
  std::vector<IlluminationRecord> records = cacheOf(field).records();
  for (IlluminationRecord& r : records) r.bsdfFraction = kProductProbabilities.bsdf;
  return fieldOf({records, cacheOf(field).unit()});
}

/// All that vertices are examined with.
struct Bench {
  const RenderScene& scene;
  const Integrator& paths;
  const GuidedSampler& guided;
  const GuidedSampler& product;
  const GuidedSampler& fixedFractions;
  const Options& options;
};

/// f |cosθ| L at a vertex, by directions from the BSDF, both guided densities, the environment, and uniform ones, as
/// many of each, weighted as by one density (balance heuristic).
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
        if (const std::optional<Vec3> wi = draw(strategy)) look(*wi, i % 2 == 0);
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

  void look(const Vec3& local, bool firstHalf) {
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
  Rng rng_;
  PathStatistics statistics_;
  int each_ = 0;
  std::vector<IncidentRadiance::Sample> samples_;
};

/// Where a convex function of one number is least in [low, high], by golden section.
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

/// The densities of which the NEVs are reported, before those of reduced mixtures. The product's shares of the BSDF
/// against the mixtures are those that its records have learnt, one for all records, or the best for each vertex: by
/// Kullback–Leibler divergence, or by the NEV itself.
constexpr std::array kDensityNames{
    "bsdf", "guided", "product", "product_fixed_fractions", "product_fraction_by_kl", "product_fraction_by_nev"};

/// What is found at one vertex.
struct Grade {
  GuidingDecision decision = GuidingDecision::noRecord;
  std::vector<double> nevs;  ///< kDensityNames, then each reduction; empty: no light was seen
  double fraction = 1;       ///< of the BSDF in the product's density
  double bestFraction = 1;   ///< by NEV
};

/// The product's density with other shares of BSDF and mixtures.
class Reshared {
 public:
  Reshared(const GuidedSampler::Vertex& product, const SurfaceHit& hit, const IncidentRadiance& light)
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
  /// Some of the BSDF there has to be.
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
    const Reshared reshared(product, hit, light);
    grade.bestFraction = reshared.fractionByNev();
    grade.nevs.push_back(*reshared.nev(reshared.fractionByKl()));
    grade.nevs.push_back(*reshared.nev(grade.bestFraction));
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

/// Of the density of that place in Grade::nevs, over the vertices that see light.
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
  const RenderScene renderScene(scene);
  const RayCamera camera(scene.camera, scene.filter);
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
  fmt::print("{}\n", report(gradeAll(bench, reductions, vertices), reductions).dump(2));
}

void declare(CLI::App& app, Options& o) {
  o.declare(app);
  app.add_option("--cache", o.cacheFolder, "Folder of the caches that lobefit made")->capture_default_str();
  app.add_option("--train", o.plan.from, "What records learn from")
      ->transform(CLI::CheckedTransformer(trainFromNames()))
      ->default_str("both");
  app.add_option("--passes", o.plan.passes, "Of training")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--vertices", o.vertices, "Where to look")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--directions", o.directions, "To look into from each vertex")
      ->check(CLI::Range(16, 1 << 20))
      ->capture_default_str();
  app.add_option("--paths", o.paths, "Along each direction, twice: the more, the less is missed of what is rare")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--reductions", o.reductions, "Costs up to which to merge mixtures, separated by commas")
      ->delimiter(',')
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  return lobe::runTool(
      "lobebench-vertices",
      "Trains a scene and grades the densities of directions at random vertices of its paths by the NEV of one sample "
      "of BSDF times cosine times light; prints JSON. Light straight from an emitter counts with the share that "
      "multiple importance sampling would leave to cosine-weighted directions.",
      argc, argv, [&](CLI::App& app) { declare(app, options); }, [&] { run(options); });
}
