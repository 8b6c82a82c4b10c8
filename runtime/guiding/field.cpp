#include "lobe/field.h"

#include <array>
#include <stdexcept>

#include <fmt/format.h>

#include "runtime/core/atomic_file.h"
#include "runtime/core/files.h"
#include "runtime/core/parallel.h"
#include "runtime/guiding/field_data.h"
#include "runtime/guiding/illumination_store.h"
#include "runtime/guiding/sample_storage_data.h"

namespace lobe {
namespace {

TrainingOptions trainingOptions(const FieldOptions& options) {
  TrainingOptions training;
  training.components = options.components;
  training.neighbours = options.neighbours;
  training.reservoir = options.reservoir;
  training.unitFraction = options.unitFraction;
  training.maxParallax = options.maxParallax;
  return training;
}

IlluminationTrainer& trainerOf(FieldData& data) {
  if (!data.trainer)
    throw std::logic_error("a field that was loaded, frozen, reduced or default-constructed cannot be trained");
  return *data.trainer;
}

/// Calls `use` with the content sorted by path index.
template <class Use>
auto inOrder(const SampleStorageData& data, const Use& use) {
  return data.isInOrder() ? use(data) : use(data.inOrder());
}

}  // namespace

void FieldOptions::validate() const {
  static_assert(kMostComponents == kMaxLightComponents);
  if (!(sceneDiagonal > 0 && std::isfinite(sceneDiagonal)))
    throw std::runtime_error(fmt::format("training option sceneDiagonal must be positive, not {}", sceneDiagonal));
  trainingOptions(*this).validate();
}

Field::Field() : data_(std::make_shared<FieldData>()) {}

Field::Field(const FieldOptions& options, const Field& earlier) : data_(std::make_shared<FieldData>()) {
  options.validate();
  isolated([&] { data_->trainer.emplace(trainingOptions(options), options.sceneDiagonal, earlier.cache().records()); });
}

Field::Field(std::shared_ptr<FieldData> data) : data_(std::move(data)) {}
Field::~Field() = default;
Field::Field(const Field&) = default;
Field& Field::operator=(const Field&) = default;

Field Field::load(const std::filesystem::path& path) {
  auto data = std::make_shared<FieldData>();
  const IlluminationFile file = IlluminationFile::open(path);
  data->frozen = isolated([&] { return loadIllumination(file); });
  return Field(std::move(data));
}

void Field::save(const std::filesystem::path& path) const {
  IlluminationInfo info;
  info.toolVersion = LOBE_VERSION;
  const std::vector<std::byte> bytes = nameErrors(path, [&] { return storeIllumination(cache(), std::move(info)); });
  writeAtomically(path, std::span<const std::byte>(bytes));
}

std::optional<double> Field::update(const SampleStorage& storage) {
  IlluminationTrainer& trainer = trainerOf(*data_);
  const auto learn = [&](const SampleStorageData& data) {
    trainer.learnFractions(data.fractions);
    return trainer.learn(std::array{std::span<const Particle>(data.photons), std::span<const Particle>(data.samples)},
                         data.requests);
  };
  return isolated([&] { return inOrder(*storage.data_, learn); });
}

void Field::refit() {
  IlluminationTrainer& trainer = trainerOf(*data_);
  isolated([&] { trainer.refit(); });
}

void Field::fill(const SampleStorage& requests, const SampleStorage& particles) {
  IlluminationTrainer& trainer = trainerOf(*data_);
  const auto fillFrom = [&](const SampleStorageData& asked, const SampleStorageData& data) {
    trainer.fill(std::array{std::span<const Particle>(data.photons), std::span<const Particle>(data.samples)},
                 asked.requests);
  };
  isolated([&] {
    inOrder(*requests.data_, [&](const SampleStorageData& asked) {
      inOrder(*particles.data_, [&](const SampleStorageData& data) { fillFrom(asked, data); });
    });
  });
}

Field Field::frozen() const {
  return fieldOf(cache());
}

const IlluminationCache& Field::cache() const {
  return data_->cache();
}

Field Field::reduced(float cost) const {
  return fieldOf(isolated([&] { return lobe::reduced(cache(), cost); }));
}

double Field::meanComponents() const {
  return cache().meanComponents();
}

double Field::undersampledFraction() const {
  return data_->trainer ? data_->trainer->undersampledFraction() : 0.0;
}

const IlluminationCache& cacheOf(const Field& field) {
  return field.cache();
}

Field fieldOf(IlluminationCache cache) {
  auto data = std::make_shared<FieldData>();
  data->frozen = std::move(cache);
  return Field(std::move(data));
}

std::size_t Field::records() const {
  return cache().size();
}

std::size_t Field::bytes() const {
  return cache().bytes();
}

}  // namespace lobe
