#include "schema/checkpoint_file.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "checkpoint_generated.h"
#include "schema/cache_checks.h"

namespace lobe {
namespace {

static_assert(sizeof(StoredPixel) == sizeof(fb::Pixel) && alignof(StoredPixel) == alignof(fb::Pixel));
static_assert(sizeof(StoredPass) == sizeof(fb::TrainingPass) && alignof(StoredPass) == alignof(fb::TrainingPass));
static_assert(sizeof(StoredPilot) == sizeof(fb::Pilot) && alignof(StoredPilot) == alignof(fb::Pilot));
static_assert(sizeof(StoredLightPathTrial) == sizeof(fb::LightPathTrial));
static_assert(std::is_trivially_copyable_v<StoredPixel> && std::is_standard_layout_v<StoredPixel>);

bool isNumber(double value) {
  return value >= 0 && std::isfinite(value);
}

void checkPixel(const StoredPixel& pixel, std::size_t index, const std::string& name) {
  for (const auto& numbers : {pixel.sum, pixel.squares})
    for (const double value : numbers)
      if (!isNumber(value)) refuseDamaged(name, fmt::format("pixel {}: a sum is negative or not finite", index));
  if (std::uint64_t{pixel.count} + pixel.dropped > std::numeric_limits<int>::max())
    refuseDamaged(name, fmt::format("pixel {}: number of samples out of range", index));
}

void checkChoices(const CheckpointInfo& info, const std::string& name) {
  constexpr double kMostPathsPerPixel = 1e6;  // far more than the trial chooses
  const auto& pilot = info.pilot;
  const auto& trial = info.lightPathTrial;
  if ((pilot && !isNumber(pilot->seconds)) || (trial && !isNumber(trial->seconds)))
    refuseDamaged(name, "the time of a choice is negative or not finite");
  if (trial && !(trial->pathsPerPixel > 0 && trial->pathsPerPixel <= kMostPathsPerPixel))
    refuseDamaged(name, "number of light paths out of range");
}

CheckpointInfo readInfo(const fb::Checkpoint& file, const std::string& name) {
  CheckpointInfo info;
  for (const fb::Setting* setting : *file.settings())
    info.settings.emplace_back(setting->name()->str(), setting->value()->str());
  info.width = file.width();
  info.height = file.height();
  info.trainingSeconds = file.seconds_training();
  info.renderingSeconds = file.seconds_rendering();
  const std::span<const StoredPass> passes = inPlace<StoredPass>(*file.passes(), name);
  info.passes.assign(passes.begin(), passes.end());
  info.undersampledFraction = file.undersampled_fraction();
  info.learntFractions = file.learnt_fractions();
  const std::span<const std::uint64_t> counters = inPlace<std::uint64_t>(*file.counters(), name);
  info.counters.assign(counters.begin(), counters.end());
  if (file.pilot()) info.pilot = std::bit_cast<StoredPilot>(*file.pilot());
  if (file.light_path_trial()) info.lightPathTrial = std::bit_cast<StoredLightPathTrial>(*file.light_path_trial());
  return info;
}

}  // namespace

CheckpointFile::CheckpointFile(FileContent file, const std::filesystem::path& path) : file_(std::move(file)) {
  const std::string name = path.string();
  const std::span<const std::byte> payload = unwrapPayload(kCheckpointFormat, file_.bytes(), name);
  const auto& root = verifiedBuffer<fb::Checkpoint>(payload, name, "checkpoint");
  info_ = readInfo(root, name);
  pixels_ = inPlace<StoredPixel>(*root.pixels(), name);
  illumination_ = std::as_bytes(std::span(root.illumination()->data(), root.illumination()->size()));
  importance_ = std::as_bytes(std::span(root.importance()->data(), root.importance()->size()));
  if (pixels_.empty() || std::uint64_t{info_.width} * info_.height != pixels_.size())
    refuseDamaged(name, fmt::format("{} pixels for a film of {}x{}", pixels_.size(), info_.width, info_.height));
  for (std::size_t i = 0; i < pixels_.size(); ++i) checkPixel(pixels_[i], i, name);
  const bool passTimes = std::ranges::all_of(info_.passes, isNumber, &StoredPass::seconds);
  if (!isNumber(info_.trainingSeconds) || !isNumber(info_.renderingSeconds) || !passTimes)
    refuseDamaged(name, "a time is negative or not finite");
  checkChoices(info_, name);
  if (!(info_.undersampledFraction >= 0 && info_.undersampledFraction <= 1))
    refuseDamaged(name, "fraction of undersampled records out of range");
}

CheckpointFile CheckpointFile::open(const std::filesystem::path& path) {
  return {FileContent(path), path};
}

std::vector<std::byte> encodeCheckpoint(const CheckpointInfo& info, std::span<const StoredPixel> pixels,
                                        std::span<const std::byte> illumination,
                                        std::span<const std::byte> importance) {
  const std::size_t vectors = pixels.size_bytes() + illumination.size() + importance.size();
  flatbuffers::FlatBufferBuilder builder(bufferSize(vectors, "the film, the illumination and the importance"));
  std::vector<flatbuffers::Offset<fb::Setting>> settings;
  for (const auto& [name, value] : info.settings) {
    const auto nameText = builder.CreateString(name);
    settings.push_back(fb::CreateSetting(builder, nameText, builder.CreateString(value)));
  }
  // In separate statements, because the order of evaluation of function arguments is unspecified.
  const auto settingVector = builder.CreateVector(settings);
  const auto pixelVector =
      builder.CreateVectorOfStructs(reinterpret_cast<const fb::Pixel*>(pixels.data()), pixels.size());
  const auto illuminationVector =
      builder.CreateVector(reinterpret_cast<const std::uint8_t*>(illumination.data()), illumination.size());
  const auto importanceVector =
      builder.CreateVector(reinterpret_cast<const std::uint8_t*>(importance.data()), importance.size());
  const auto passVector =
      builder.CreateVectorOfStructs(reinterpret_cast<const fb::TrainingPass*>(info.passes.data()), info.passes.size());
  const auto counterVector = builder.CreateVector(info.counters);
  const auto pilot = info.pilot ? std::optional(std::bit_cast<fb::Pilot>(*info.pilot)) : std::nullopt;
  const auto trial =
      info.lightPathTrial ? std::optional(std::bit_cast<fb::LightPathTrial>(*info.lightPathTrial)) : std::nullopt;
  builder.Finish(fb::CreateCheckpoint(builder, settingVector, info.width, info.height, pixelVector, illuminationVector,
                                      importanceVector, info.trainingSeconds, info.renderingSeconds, passVector,
                                      info.undersampledFraction, info.learntFractions, counterVector,
                                      pilot ? &*pilot : nullptr, trial ? &*trial : nullptr));
  return wrapPayload(kCheckpointFormat, std::as_bytes(std::span(builder.GetBufferPointer(), builder.GetSize())));
}

}  // namespace lobe
