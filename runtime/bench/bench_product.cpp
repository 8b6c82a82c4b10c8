// lobebench-product: the time of one product sample with its density, for the lazy product and the eager product of
// Herholz et al. 2016, and the time of an incoherent ray for comparison.

#include <algorithm>
#include <ctime>
#include <memory>
#include <numbers>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "runtime/bench/eager_product.h"
#include "runtime/core/random.h"
#include "runtime/core/sampling.h"
#include "runtime/core/statistics.h"
#include "runtime/guiding/illumination_cache.h"
#include "runtime/guiding/reflectance.h"
#include "runtime/render/film/camera.h"
#include "runtime/render/geometry/raytracer.h"
#include "runtime/tools/json_text.h"
#include "runtime/tools/tool.h"
#include "scenes/mitsuba/reader.h"

namespace {

using namespace lobe;

constexpr int kColdRecords = 100000;
constexpr int kHotRecords = 8;
constexpr int kRays = 200000;
constexpr int kBatch = 20000;  // samples or rays that are timed together

struct Options {
  std::string scene;
  ReadOptions read;
  int rounds = 15;
  std::string target;
};

/// CPU time of this thread, which other processes do not affect.
double threadSeconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

template <class F>
double nanosecondsEach(int count, const F& work) {
  const double start = threadSeconds();
  work();
  return 1e9 * (threadSeconds() - start) / count;
}

Gaussian randomGaussian(Rng& rng, float weight) {
  const auto width = [&] { return 0.05f * std::pow(8.0f, rng.uniform()); };
  const float r = 0.9f * std::sqrt(rng.uniform()), phi = 2 * std::numbers::pi_v<float> * rng.uniform();
  const float along = width(), across = width();
  Gaussian g = rotated({weight, r, 0, {along * along, 0, across * across}}, {std::cos(phi), std::sin(phi)});
  return g;
}

/// Records of k Gaussians in the renderer's memory layout, in random order, so that the hardware cannot prefetch them.
class Lights {
 public:
  Lights(int components, int count) {
    Rng rng(1, 0, static_cast<std::uint64_t>(components));
    std::vector<IlluminationRecord> records;
    for (int i = 0; i < count; ++i) {
      IlluminationRecord r{.position = Vec3(static_cast<float>(i), 0, 0),
                           .normal = Vec3::UnitZ(),
                           .tangent = Vec3::UnitX(),
                           .radius = 0.4f,
                           .background = 0.3f,
                           .irradiance = 0,
                           .samples = 1000,
                           .bsdfFraction = 0.2f,
                           .count = components,
                           .components = {}};
      for (int k = 0; k < components; ++k)
        r.components[static_cast<std::size_t>(k)] = randomGaussian(rng, 1 / static_cast<float>(components));
      records.push_back(r);
    }
    cache_ = IlluminationCache(records, 1);
    for (const IlluminationRecord& r : records) order_.push_back(cache_.find(r.position, r.normal));
    for (std::size_t i = order_.size(); i > 1; --i)
      std::swap(order_[i - 1], order_[static_cast<std::size_t>(rng.uniform() * static_cast<float>(i))]);
  }

  const std::vector<const PackedRecord*>& order() const { return order_; }

 private:
  IlluminationCache cache_;
  std::vector<const PackedRecord*> order_;
};

std::vector<Reflectance> reflectances(int components) {
  Rng rng(2, 0, static_cast<std::uint64_t>(components));
  std::vector<Reflectance> all(kHotRecords);
  for (Reflectance& r : all)
    for (int k = 0; k < components; ++k) r.gaussians.add(randomGaussian(rng, 0.3f));
  return all;
}

/// Random numbers generated in advance, so that they are not timed. There are too many of them for branch predictors to
/// learn.
struct Draw {
  float choice;
  Vec2 u;
};

std::vector<Draw> draws() {
  Rng rng(3);
  std::vector<Draw> all(kBatch);
  for (Draw& d : all) {
    d.choice = rng.uniform();
    d.u = rng.uniform2();
  }
  return all;
}

/// Times samples with their densities, one per record, in the order of the records.
class SampleTimer {
 public:
  SampleTimer(int reflectanceComponents, const Lights& lights)
      : reflectances_(reflectances(reflectanceComponents)), lights_(lights), draws_(draws()) {}

  double lazy(bool ahead) {
    return timed(ahead, [](const GaussiansView& one, const GaussiansView& two) { return Product(one, 0, two); });
  }
  double eager(int lanes) {
    return timed(false,
                 [lanes](const GaussiansView& one, const GaussiansView& two) { return EagerProduct(one, two, lanes); });
  }

  /// Throws std::runtime_error unless both products give the same density.
  void check() const {
    for (std::size_t i = 0; i < 100; ++i) {
      const GaussiansView one = reflectances_[i % kHotRecords].gaussians.view(),
                          two = lights_.order()[i % lights_.order().size()]->gaussians();
      const Product product(one, 0, two);
      const Vec2 y = product.sample(draws_[i].choice, draws_[i].u);
      for (const int lanes : {4, 8}) {
        if (two.stride % lanes != 0) continue;
        const float ratio = EagerProduct(one, two, lanes).pdf(y) / product.pdf(y);
        if (!(std::abs(ratio - 1) < 1e-2f))
          throw std::runtime_error(
              fmt::format("the densities of eager and lazy product differ by a factor of {}", ratio));
      }
    }
  }

 private:
  template <class Make>
  double timed(bool ahead, const Make& make) {
    const std::vector<const PackedRecord*>& order = lights_.order();
    return nanosecondsEach(kBatch, [&] {
      for (std::size_t i = 0; i < kBatch; ++i) {
        const PackedRecord& record = *order[next_];
        if (++next_ == order.size()) next_ = 0;
        if (ahead)
          for (int b = 0; b < 384; b += 64) __builtin_prefetch(reinterpret_cast<const char*>(order[next_]) + b);
        const auto product = make(reflectances_[i % kHotRecords].gaussians.view(), record.gaussians());
        const Draw& d = draws_[i];
        sink_ = sink_ + product.pdf(product.sample(d.choice, d.u));
      }
    });
  }

  std::vector<Reflectance> reflectances_;
  const Lights& lights_;
  std::vector<Draw> draws_;
  std::size_t next_ = 0;
  volatile float sink_ = 0;
};

/// Rays of diffuse camera paths in random order, so that consecutive rays are incoherent.
std::vector<Ray> incoherentRays(const Scene& scene, const RayTracer& tracer) {
  constexpr int kBounces = 6;
  const RayCamera camera(scene.camera, scene.filter);
  Sampler rng(4);
  std::vector<Ray> rays;
  while (static_cast<int>(rays.size()) < kRays) {
    const Vec2 pixel = rng.uniform2();
    Ray ray = camera.sample(static_cast<int>(pixel.x() * static_cast<float>(camera.width())),
                            static_cast<int>(pixel.y() * static_cast<float>(camera.height())), rng);
    for (int i = 0; i < kBounces; ++i) {
      const std::optional<SurfaceHit> hit = tracer.trace(ray);
      if (!hit) break;
      Vec3 wi = squareToCosineHemisphere(rng.uniform2());
      wi.z() = std::copysign(wi.z(), hit->wo.z());
      ray = spawnRay(*hit, hit->frame.toWorld(wi).normalized());
      rays.push_back(ray);
    }
  }
  for (std::size_t i = rays.size(); i > 1; --i)
    std::swap(rays[i - 1], rays[static_cast<std::size_t>(rng.uniform() * static_cast<float>(i))]);
  return rays;
}

class RayTimer {
 public:
  RayTimer(const Scene& scene, const RayTracer& tracer) : tracer_(tracer), rays_(incoherentRays(scene, tracer)) {}

  double nanoseconds() {
    return nanosecondsEach(kBatch, [&] {
      for (int i = 0; i < kBatch; ++i) {
        hits_ = hits_ + tracer_.intersect(rays_[next_]).has_value();
        if (++next_ == rays_.size()) next_ = 0;
      }
    });
  }

 private:
  const RayTracer& tracer_;
  std::vector<Ray> rays_;
  std::size_t next_ = 0;
  volatile std::size_t hits_ = 0;
};

/// One measurement.
struct Column {
  std::string name;
  std::function<double()> time;
  std::vector<double> nanoseconds{};
};

/// Alternates between the measurements, so that a slowdown of the machine affects all of them.
void timeInTurns(std::vector<Column>& columns, int rounds) {
  for (Column& c : columns) c.time();
  for (int i = 0; i < rounds; ++i)
    for (Column& c : columns) c.nanoseconds.push_back(c.time());
}

struct LightSets {
  explicit LightSets(int components) : hot(components, kHotRecords), cold(components, kColdRecords) {}
  Lights hot, cold;
};

nlohmann::ordered_json row(int one, int two, const LightSets& lights, RayTimer& rays, const Options& o) {
  SampleTimer hot(one, lights.hot), cold(one, lights.cold);
  hot.check();
  std::vector<Column> columns{
      {"hot", [&] { return hot.lazy(false); }},        {"hot_eager_4", [&] { return hot.eager(4); }},
      {"cold", [&] { return cold.lazy(false); }},      {"cold_prefetched", [&] { return cold.lazy(true); }},
      {"cold_eager_4", [&] { return cold.eager(4); }}, {"ray", [&] { return rays.nanoseconds(); }}};
  if (two > kPaddingMultiple) columns.push_back({"hot_eager_8", [&] { return hot.eager(8); }});
  timeInTurns(columns, o.rounds);
  nlohmann::ordered_json json{{"reflectance", one}, {"light", two}};
  for (const Column& c : columns) json[c.name] = median(c.nanoseconds);
  return json;
}

void chooseTarget(const std::string& name) {
  if (name.empty()) return;
  std::string known;
  for (const std::int64_t target : kernelTargets()) {
    if (kernelTargetName(target) == name) return useKernelTarget(target);
    known += " " + kernelTargetName(target);
  }
  throw UsageError(fmt::format("--target: '{}' is not available; choose one of{}", name, known));
}

void run(const Options& o) {
  chooseTarget(o.target);
  const Scene scene = readScene(o.scene, o.read);
  const RayTracer tracer(scene);
  RayTimer rays(scene, tracer);
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const int two : {4, 8}) {
    const LightSets lights(two);
    for (const int one : {1, 2, 3, 4, 5, 8}) rows.push_back(row(one, two, lights, rays, o));
  }
  const std::string used = o.target.empty() ? kernelTargetName(kernelTargets().front()) : o.target;
  fmt::print("{}\n", jsonText({{"target", used}, {"rows", rows}}));
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  return runTool(
      "lobebench-product", "Times product samples with their densities; prints JSON with nanoseconds on one thread.",
      argc, argv,
      [&](CLI::App& app) {
        app.add_option("scene", options.scene, "Mitsuba scene file (XML) in which rays are traced")->required();
        app.add_option("--rounds", options.rounds, "Number of rounds in which everything is timed")
            ->check(CLI::PositiveNumber)
            ->capture_default_str();
        app.add_option("--target", options.target, "Instruction set: SSE4, AVX2 or AVX3 (default: the best available)");
        app.add_flag("--lenient", options.read.lenient,
                     "Replace or leave out faulty parts of the scene, with warnings");
        addDefinitions(app, options.read.definitions);
      },
      [&] { run(options); });
}
