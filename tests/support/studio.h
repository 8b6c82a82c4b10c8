#pragma once
// A scene with its caches and trained incident radiance, for tests that render.

#include <optional>

#include "fitter/compile.h"
#include "runtime/guiding/field_data.h"
#include "runtime/render/integrators/bidirectional_integrator.h"
#include "runtime/render/integrators/learn_sample_counts.h"
#include "runtime/render/integrators/renderer.h"
#include "runtime/render/training/training.h"
#include "scenes/camera.h"
#include "scenes/mitsuba/reader.h"
#include "scenes/scene_lobes.h"
#include "tests/support/tool_run.h"

namespace lobe::test {

/// Everything needed to render a scene with each integrator. Caches are coarse and training is short, since estimates
/// must be unbiased however inaccurate the mixtures are.
class Studio {
 public:
  explicit Studio(Scene s, int width, int height) : scene_(std::move(s)) {
    scene_.camera.width = width;
    scene_.camera.height = height;
    scene_.camera.horizontalFov = horizontalFov(scene_.camera, width, height);
    renderScene_.emplace(scene_);
    camera_.emplace(scene_.camera, scene_.filter);
    CompileOptions options;
    options.directory = folder_ / "lobes";
    options.settings.samples = 512;
    options.settings.components = 4;
    options.elevations = 12;
    options.directions = 48;
    for (const CompileJob& job : planCompile(collectLobes(scene_), options)) runCompile(job, [] {});
    caches_.emplace(options.directory, lobeRequests(scene_), "lobefit");
    TrainingPlan plan;
    plan.passes = 3;
    plan.photons = 20000;
    plan.importons = 8000;
    plan.seed = 5;
    plan.keepImportance = true;
    const TrainedIllumination trained = trainIllumination(*renderScene_, *camera_, &*caches_, plan);
    illumination_ = trained.field, importance_ = trained.importance;
    guided_.emplace(scene_, illumination_, nullptr);
    importanceSampler_.emplace(scene_, importance_, nullptr);
    product_.emplace(scene_, illumination_, &*caches_);
    guidedCounts_ = countsFor(*guided_);
    productCounts_ = countsFor(*product_);
  }

  Film render(const Integrator& integrator, int samples, std::uint64_t seed) const {
    Film film(camera_->width(), camera_->height());
    // For z-tests, whose pixels must be independent.
    lobe::render(*camera_, integrator, film,
                 {seed, samples, std::nullopt, PixelSampling::sobol, PixelFiltering::importance});
    return film;
  }

  PathIntegrator path() const { return {*renderScene_, {}}; }
  GuidedIntegrator guided() const { return {*renderScene_, with(*guidedCounts_), *guided_}; }
  GuidedIntegrator product() const { return {*renderScene_, with(*productCounts_), *product_}; }
  GuidedIntegrator productWithThroughputRoulette() const { return {*renderScene_, {}, *product_}; }
  GuidedBdptIntegrator guidedBdpt() const { return {*renderScene_, *camera_, {}, *guided_, *importanceSampler_}; }
  GuidedBdptIntegrator productBdpt() const { return {*renderScene_, *camera_, {}, *product_, *importanceSampler_}; }
  const RayCamera& camera() const { return *camera_; }
  const RenderScene& renderScene() const { return *renderScene_; }
  const Scene& scene() const { return scene_; }
  const GuidedSampler& guidedSampler() const { return *guided_; }
  const GuidedSampler& productSampler() const { return *product_; }
  const GuidedSampler& importanceSampler() const { return *importanceSampler_; }
  const SampleCountModel& guidedCounts() const { return *guidedCounts_; }
  const SampleCountModel& productCounts() const { return *productCounts_; }
  const IlluminationCache& illumination() const { return cacheOf(illumination_); }
  const Field& importance() const { return importance_; }
  std::filesystem::path lobes() const { return folder_ / "lobes"; }

 private:
  SampleCountModel countsFor(const GuidedSampler& guide) const {
    return learnSampleCounts(*renderScene_, *camera_, {}, guide, illumination_.records(), 5000, 6);
  }
  static PathOptions with(const SampleCountModel& counts) {
    PathOptions options;
    options.counts = &counts;
    return options;
  }

  Folder folder_;
  Scene scene_;
  std::optional<RenderScene> renderScene_;
  std::optional<RayCamera> camera_;
  std::optional<LobeCacheSet> caches_;
  Field illumination_, importance_;
  std::optional<GuidedSampler> guided_, product_, importanceSampler_;
  std::optional<SampleCountModel> guidedCounts_, productCounts_;
};

}  // namespace lobe::test
