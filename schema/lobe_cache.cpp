#include "schema/lobe_cache.h"

#include <fmt/format.h>

#include "lobe_generated.h"
#include "schema/cache_checks.h"

namespace lobe {
namespace {

// The fields of the generated structs are private, so that only sizes and alignments can be compared here. A test
// writes with one type and reads with the other to check the order of the fields.
static_assert(sizeof(CacheComponent) == sizeof(fb::Component) && alignof(CacheComponent) == alignof(fb::Component));
static_assert(sizeof(CacheRecord) == sizeof(fb::Record) && alignof(CacheRecord) == alignof(fb::Record));
static_assert(std::is_trivially_copyable_v<CacheComponent> && std::is_standard_layout_v<CacheComponent>);
static_assert(std::is_trivially_copyable_v<CacheRecord> && std::is_standard_layout_v<CacheRecord>);

constexpr std::uint8_t kLastGridKind = 1;

void checkRecord(const CacheRecord& r, std::size_t index, std::span<const CacheComponent> components,
                 const std::string& name) {
  const auto require = [&](bool condition, const char* fault) {
    if (!condition) refuseDamaged(name, fmt::format("record {}: {}", index, fault));
  };
  require(allFinite({r.integral, r.albedo, r.cosineMass, r.outside, r.nev, r.nevCoverage, r.worstRatio}),
          "a number is not finite");
  require(r.integral >= 0 && r.albedo >= 0 && r.nev >= 0 && r.nevCoverage >= 0 && r.worstRatio >= 0,
          "a negative quantity");
  require((r.cosineMass > 0 || r.count == 0) && r.cosineMass <= 1.0001f, "cosine mass out of range");
  require(r.outside >= 0 && r.outside <= 1, "fraction outside the disc out of range");
  require(r.count <= kMaxCacheComponents, "number of components out of range");
  require(componentsInRange(r.first, r.count, components), "components out of range");
  require(r.count == 0 || weightsSumToOne(components.subspan(r.first, r.count)), "the weights do not sum to one");
}

FitSettings readSettings(const fb::FitSettings& s, const std::string& file) {
  const std::optional<FitMethod> method = fitMethodOf(s.method() ? s.method()->string_view() : "");
  if (!method) refuseDamaged(file, "its records were fitted by an unknown method");
  if (s.samples() > kMaxFitSamples) refuseDamaged(file, fmt::format("fitted to {} samples: out of range", s.samples()));
  if (!allFinite({s.reduction(), s.quality()}) || s.reduction() < 0 || s.quality() < 0)
    refuseDamaged(file, "reduction or quality of the fit out of range");
  return {*method, s.components(), s.samples(), s.reduction(), s.revision(), s.quality(), s.fixed_grid()};
}

LobeCacheInfo readInfo(const fb::LobeCache& cache, const std::string& file) {
  LobeCacheInfo info;
  info.toolVersion = cache.tool_version()->str();
  info.model = cache.model()->str();
  info.key = cache.key()->str();
  info.summary = cache.summary()->str();
  info.modelRevision = cache.model_revision();
  info.settings = readSettings(*cache.settings(), file);
  info.gridKind = cache.grid_kind();
  info.gridCount = cache.grid_count();
  info.quarter = cache.quarter();
  return info;
}

}  // namespace

LobeCache::LobeCache(FileContent file, const std::filesystem::path& path) : file_(std::move(file)) {
  const std::string name = path.string();
  const std::span<const std::byte> payload = unwrapPayload(kLobeFormat, file_.bytes(), name);
  header_ = containerHeader(file_.bytes());
  const auto& cache = verifiedBuffer<fb::LobeCache>(payload, name, "lobe cache");
  info_ = readInfo(cache, name);
  records_ = inPlace<CacheRecord>(*cache.records(), name);
  components_ = inPlace<CacheComponent>(*cache.components(), name);
  if (info_.gridKind > kLastGridKind) refuseDamaged(name, fmt::format("grid of unknown kind {}", info_.gridKind));
  lookup_ = {cache.lookup()->data(), cache.lookup()->size()};
  if (info_.gridCount < 1 || info_.gridCount != lookup_.size())
    refuseDamaged(name, fmt::format("{} look-ups for a grid of {} directions", lookup_.size(), info_.gridCount));
  checkComponents(components_, name);
  for (std::size_t i = 0; i < records_.size(); ++i) {
    checkRecord(records_[i], i, components_, name);
    if (records_[i].entry >= info_.gridCount) refuseDamaged(name, fmt::format("record {}: direction out of range", i));
  }
  for (std::uint32_t i = 0; i < lookup_.size(); ++i)
    if (lookup_[i] >= records_.size()) refuseDamaged(name, fmt::format("look-up {}: record out of range", i));
}

LobeCache LobeCache::open(const std::filesystem::path& path) {
  return LobeCache(FileContent(path), path);
}

std::optional<FitMethod> fitMethodOf(std::string_view name) {
  const auto found = std::ranges::find(kFitMethodNames, name);
  if (found == kFitMethodNames.end()) return std::nullopt;
  return static_cast<FitMethod>(found - kFitMethodNames.begin());
}

std::string lobeFileName(const std::string& model, const std::string& key) {
  return fmt::format("{}-{:016x}.lobe", model, hashText(key));
}

std::vector<std::byte> encodeLobeCache(const LobeCacheInfo& info, std::span<const CacheRecord> records,
                                       std::span<const CacheComponent> components,
                                       std::span<const std::uint32_t> lookup) {
  const std::size_t vectors = records.size_bytes() + components.size_bytes() + lookup.size_bytes();
  flatbuffers::FlatBufferBuilder builder(bufferSize(vectors, "the records and the look-ups of the lobe"));
  const FitSettings& s = info.settings;
  const auto settings = fb::CreateFitSettings(builder, builder.CreateString(nameOf(s.method)), s.components, s.samples,
                                              s.reduction, s.revision, s.quality, s.fixedGrid);
  // In separate statements, because the order of evaluation of function arguments is unspecified.
  const auto toolVersion = builder.CreateString(info.toolVersion);
  const auto model = builder.CreateString(info.model);
  const auto key = builder.CreateString(info.key);
  const auto summary = builder.CreateString(info.summary);
  const auto recordVector =
      builder.CreateVectorOfStructs(reinterpret_cast<const fb::Record*>(records.data()), records.size());
  const auto componentVector =
      builder.CreateVectorOfStructs(reinterpret_cast<const fb::Component*>(components.data()), components.size());
  const auto lookupVector = builder.CreateVector(lookup.data(), lookup.size());
  builder.Finish(fb::CreateLobeCache(builder, toolVersion, model, key, info.modelRevision, summary, settings,
                                     info.gridKind, info.gridCount, lookupVector, info.quarter, recordVector,
                                     componentVector));
  return wrapPayload(kLobeFormat, std::as_bytes(std::span(builder.GetBufferPointer(), builder.GetSize())));
}

}  // namespace lobe
