#include "schema/illumination_file.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <fmt/format.h>

#include "illumination_generated.h"
#include "schema/cache_checks.h"

namespace lobe {
namespace {

static_assert(sizeof(StoredIllumination) == sizeof(fb::IlluminationRecord));
static_assert(std::is_trivially_copyable_v<StoredIllumination> && std::is_standard_layout_v<StoredIllumination>);

constexpr float kFrameTolerance = 1e-3f;
// BSDF sampling must keep a positive probability; training learns no fractions below 0.05.
constexpr float kMinStoredFraction = 0.01f;

using Vector = std::array<float, 3>;

float dot(const Vector& a, const Vector& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0f);
}

bool isUnit(const Vector& v) {
  return std::abs(dot(v, v) - 1) <= kFrameTolerance;
}

void checkRecord(const StoredIllumination& r, std::size_t index, std::span<const CacheComponent> components,
                 const std::string& name) {
  const auto require = [&](bool condition, const char* fault) {
    if (!condition) refuseDamaged(name, fmt::format("record {}: {}", index, fault));
  };
  require(allFinite({r.position[0], r.position[1], r.position[2], r.radius, r.irradiance, r.samples}),
          "a number is not finite");
  // These conditions are false for numbers that are not finite.
  require(isUnit(r.normal) && isUnit(r.tangent) && std::abs(dot(r.normal, r.tangent)) <= kFrameTolerance,
          "normal and tangent are not orthonormal");
  require(r.radius > 0, "the radius is not positive");
  require(r.background >= 0 && r.background <= 1, "weight of the background out of range");
  require(r.irradiance >= 0, "a negative irradiance");
  require(r.samples >= 0, "a negative number of samples");
  require(r.bsdfFraction >= kMinStoredFraction && r.bsdfFraction < 1, "BSDF sampling fraction out of range");
  require(r.count <= kMaxStoredComponents, "number of components out of range");
  require(componentsInRange(r.first, r.count, components), "components out of range");
  require(r.count > 0 || r.background == 1, "no components, and the background does not have all weight");
  require(r.count == 0 || weightsSumToOne(components.subspan(r.first, r.count)), "the weights do not sum to one");
}

IlluminationInfo readInfo(const fb::Illumination& file) {
  const fb::TrainingSettings& s = *file.settings();
  return {.toolVersion = file.tool_version()->str(),
          .scene = file.scene()->str(),
          .sceneHash = file.scene_hash(),
          .settings = {s.from()->str(), s.passes(), s.photons(), s.importons(), s.components(), s.seed(),
                       s.learnt_fractions(), s.max_depth()},
          .particles = file.particles(),
          .undersampledFraction = file.undersampled_fraction(),
          .unit = file.unit()};
}

}  // namespace

IlluminationFile::IlluminationFile(FileContent file, const std::filesystem::path& path) : file_(std::move(file)) {
  const std::string name = path.string();
  const std::span<const std::byte> payload = unwrapPayload(kIlluminationFormat, file_.bytes(), name);
  header_ = containerHeader(file_.bytes());
  const auto& root = verifiedBuffer<fb::Illumination>(payload, name, "trained illumination file");
  info_ = readInfo(root);
  records_ = inPlace<StoredIllumination>(*root.records(), name);
  components_ = inPlace<CacheComponent>(*root.components(), name);
  if (root.likelihood_gains()) likelihoodGains_ = inPlace<float>(*root.likelihood_gains(), name);
  // The look-up divides by the unit, whose inverse would overflow if it were subnormal.
  if (!(info_.unit > 0 && std::isnormal(info_.unit))) refuseDamaged(name, "the unit of length is out of range");
  if (!(info_.undersampledFraction >= 0 && info_.undersampledFraction <= 1))
    refuseDamaged(name, "fraction of undersampled records out of range");
  if (info_.settings.maxDepth < 0) refuseDamaged(name, "maximum length of paths out of range");
  checkComponents(components_, name);
  if (!likelihoodGains_.empty() && likelihoodGains_.size() != records_.size())
    refuseDamaged(name, "the number of likelihood gains is not that of the records");
  if (!std::ranges::all_of(likelihoodGains_, [](float gain) { return std::isfinite(gain); }))
    refuseDamaged(name, "a likelihood gain is not finite");
  for (std::size_t i = 0; i < records_.size(); ++i) {
    checkRecord(records_[i], i, components_, name);
    // The cell size of the look-up follows from the unit, so that a much larger radius would exhaust the memory.
    if (records_[i].radius > info_.unit)
      refuseDamaged(name, fmt::format("record {}: radius over the unit of length", i));
  }
}

IlluminationFile IlluminationFile::open(const std::filesystem::path& path) {
  return IlluminationFile(FileContent(path), path);
}

IlluminationFile IlluminationFile::parse(std::span<const std::byte> bytes, const std::filesystem::path& path) {
  return IlluminationFile(FileContent(bytes), path);
}

std::vector<std::byte> encodeIllumination(const IlluminationInfo& info, std::span<const StoredIllumination> records,
                                          std::span<const CacheComponent> components,
                                          std::span<const float> likelihoodGains) {
  const std::size_t vectors = records.size_bytes() + components.size_bytes() + likelihoodGains.size_bytes();
  flatbuffers::FlatBufferBuilder builder(bufferSize(vectors, "the records of the illumination"));
  const StoredTrainingSettings& s = info.settings;
  const auto settings = fb::CreateTrainingSettings(builder, builder.CreateString(s.from), s.passes, s.photons,
                                                   s.importons, s.components, s.seed, s.learntFractions, s.maxDepth);
  const auto toolVersion = builder.CreateString(info.toolVersion);
  const auto scene = builder.CreateString(info.scene);
  const auto recordVector =
      builder.CreateVectorOfStructs(reinterpret_cast<const fb::IlluminationRecord*>(records.data()), records.size());
  const auto componentVector =
      builder.CreateVectorOfStructs(reinterpret_cast<const fb::Component*>(components.data()), components.size());
  const auto gainVector = builder.CreateVector(likelihoodGains.data(), likelihoodGains.size());
  builder.Finish(fb::CreateIllumination(builder, toolVersion, scene, info.sceneHash, settings, info.particles,
                                        info.undersampledFraction, info.unit, recordVector, componentVector,
                                        gainVector));
  return wrapPayload(kIlluminationFormat, std::as_bytes(std::span(builder.GetBufferPointer(), builder.GetSize())));
}

}  // namespace lobe
