#include "runtime/guiding/illumination_store.h"

#include <algorithm>

namespace lobe {
namespace {

static_assert(kMaxStoredComponents == std::tuple_size_v<decltype(IlluminationRecord::components)>);

std::array<float, 3> stored(const Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

Vec3 loaded(const std::array<float, 3>& v) {
  return {v[0], v[1], v[2]};
}

StoredIllumination stored(const IlluminationRecord& r, std::size_t first) {
  return {.position = stored(r.position),
          .normal = stored(r.normal),
          .tangent = stored(r.tangent),
          .radius = r.radius,
          .background = r.background,
          .irradiance = r.irradiance,
          .samples = r.samples,
          .bsdfFraction = r.bsdfFraction,
          .first = static_cast<std::uint32_t>(first),
          .count = static_cast<std::uint32_t>(r.count)};
}

IlluminationRecord loaded(const StoredIllumination& s, float likelihoodGain,
                          std::span<const CacheComponent> components) {
  IlluminationRecord record{.position = loaded(s.position),
                            .normal = loaded(s.normal),
                            .tangent = loaded(s.tangent),
                            .radius = s.radius,
                            .background = s.background,
                            .irradiance = s.irradiance,
                            .samples = s.samples,
                            .bsdfFraction = s.bsdfFraction,
                            .likelihoodGain = likelihoodGain,
                            .count = static_cast<std::int32_t>(s.count),
                            .components = {}};
  std::ranges::transform(components, record.components.begin(), [](const CacheComponent& c) {
    return Gaussian{c.weight, c.meanX, c.meanY, {c.covXX, c.covXY, c.covYY}};
  });
  return record;
}

}  // namespace

std::vector<std::byte> storeIllumination(const IlluminationCache& cache, IlluminationInfo info) {
  std::vector<StoredIllumination> records;
  std::vector<CacheComponent> components;
  std::vector<float> likelihoodGains;
  for (const IlluminationRecord& r : cache.records()) {
    records.push_back(stored(r, components.size()));
    likelihoodGains.push_back(r.likelihoodGain);
    for (const Gaussian& g : r.gaussians())
      components.push_back({g.weight, g.meanX, g.meanY, g.cov.xx, g.cov.xy, g.cov.yy});
  }
  info.unit = cache.unit();
  return encodeIllumination(info, records, components, likelihoodGains);
}

IlluminationCache loadIllumination(const IlluminationFile& file) {
  std::vector<IlluminationRecord> records;
  records.reserve(file.records().size());
  for (const StoredIllumination& s : file.records())
    records.push_back(loaded(s, file.likelihoodGain(s), file.components(s)));
  return {records, file.info().unit};
}

}  // namespace lobe
