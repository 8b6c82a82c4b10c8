#include "runtime/tools/stored_illumination.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "runtime/guiding/field_data.h"
#include "runtime/guiding/illumination_store.h"
#include "scenes/scene_hash.h"

namespace lobe {
namespace {

/// File name with its folder ("kitchen/scene.xml"), because many scene files have the same name.
std::string nameOf(const std::filesystem::path& sceneFile) {
  const std::filesystem::path whole = std::filesystem::weakly_canonical(sceneFile);
  return (whole.parent_path().filename() / whole.filename()).string();
}

std::string nameOf(TrainFrom from) {
  const std::map<std::string, TrainFrom> names = trainFromNames();
  return std::ranges::find(names, from, [](const auto& entry) { return entry.second; })->first;
}

StoredTrainingSettings settingsOf(const TrainingPlan& plan, const TrainedIllumination& trained) {
  const TrainingReport& report = trained.report;
  return {.from = nameOf(plan.from),
          .passes = static_cast<std::uint32_t>(report.passes.size()),
          .photons = static_cast<std::uint32_t>(plan.photons),
          .importons = static_cast<std::uint32_t>(plan.importons),
          .components = static_cast<std::uint32_t>(plan.records.components),
          .seed = plan.seed,
          .learntFractions = report.learntFractions,
          .maxDepth = trained.maxDepth};
}

}  // namespace

std::vector<std::byte> encodeIllumination(const TrainedIllumination& trained, const TrainingPlan& plan,
                                          const Scene& scene, const std::filesystem::path& sceneFile) {
  IlluminationInfo info;
  info.toolVersion = LOBE_VERSION;
  info.scene = nameOf(sceneFile);
  info.sceneHash = lightHash(scene);
  info.settings = settingsOf(plan, trained);
  info.particles = trained.report.particles();
  info.undersampledFraction = trained.report.undersampledFraction;
  return storeIllumination(cacheOf(trained.field), std::move(info));
}

TrainedIllumination restoreIllumination(const IlluminationFile& file, const std::filesystem::path& path,
                                        const Scene& scene) {
  const IlluminationInfo& info = file.info();
  const std::uint64_t hash = lightHash(scene);
  if (hash != info.sceneHash)
    throw std::runtime_error(fmt::format(
        "{}: trained for another scene ({}, hash {:016x}; this one has {:016x}): train again, with --save-illumination",
        path.string(), info.scene, info.sceneHash, hash));
  TrainedIllumination trained;
  trained.field = fieldOf(loadIllumination(file));
  trained.report.undersampledFraction = info.undersampledFraction;
  trained.report.learntFractions = info.settings.learntFractions;
  trained.maxDepth = info.settings.maxDepth;
  return trained;
}

}  // namespace lobe
