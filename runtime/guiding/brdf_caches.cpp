#include "runtime/guiding/brdf_caches.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <map>
#include <numbers>
#include <stdexcept>
#include <system_error>
#include <tuple>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "runtime/mixture/kernels.h"
#include "runtime/mixture/lookup.h"
#include "runtime/mixture/packing.h"

namespace lobe {
namespace {

// The components of a cache file are used in place as Gaussians.
static_assert(sizeof(CacheComponent) == sizeof(Gaussian) && alignof(CacheComponent) == alignof(Gaussian));

std::span<const Gaussian> asGaussians(std::span<const CacheComponent> components) {
  return {reinterpret_cast<const Gaussian*>(components.data()), components.size()};
}

/// Opens the file of a lobe; throws std::runtime_error if it is missing, damaged or stale.
LobeCache openFor(const std::filesystem::path& folder, const LobeRequest& request) {
  const std::filesystem::path path = folder / lobeFileName(request.model, request.key);
  std::error_code error;
  if (!std::filesystem::exists(path, error))
    throw std::runtime_error(fmt::format("{}: {}", path.string(), error ? error.message() : "missing"));
  LobeCache cache = LobeCache::open(path);
  if (cache.info().key != request.key || cache.info().modelRevision != request.revision)
    throw std::runtime_error(path.string() + ": stale, it was fitted for another version of the lobe");
  return cache;
}

[[noreturn]] void refuseIndex(int lobe, std::size_t requests) {
  throw std::out_of_range(fmt::format("TintedLobe::lobe is {}, but the cache set has {} requests", lobe, requests));
}

}  // namespace

BrdfCaches::Entry::Entry(LobeCache opened, float reduction)
    : cache(std::move(opened)),
      grid{static_cast<GridKind>(cache.info().gridKind), static_cast<int>(cache.info().gridCount)} {
  for (const CacheRecord& r : cache.records()) {
    const std::span<const Gaussian> fitted = asGaussians(cache.components(r));
    Mixture mixture(fitted.begin(), fitted.end());
    if (reduction > 0) reduce(mixture, reduction);
    const int count = static_cast<int>(mixture.size()), stride = paddedCount(count);
    records.push_back({toDisc(grid.direction(static_cast<int>(r.entry))), lanes.size(), stride, count,
                       r.integral / std::max(1.0f - r.outside, 0.1f), r.albedo, r.cosineMass});
    lanes.resize(lanes.size() + static_cast<std::size_t>(stride) * kGaussianFields);
    packGaussians(mixture, lanes.data() + records.back().first, stride);
  }
  lanes.resize(lanes.size() + kMaxVectorLanes);  // padding lanes: kernels read whole SIMD vectors
  if (grid.kind == GridKind::elevation) findSteps();
}

void BrdfCaches::Entry::findSteps() {
  recordOfStep = {cache.lookup(0)};
  for (int i = 1; i < grid.count; ++i) {
    const std::uint32_t record = cache.lookup(static_cast<std::uint32_t>(i));
    if (record == recordOfStep.back()) continue;
    steps.push_back((grid.direction(i - 1) + grid.direction(i)).normalized().z());
    recordOfStep.push_back(record);
  }
}

const BrdfCaches::Record& BrdfCaches::Entry::nearest(const Vec3& wo) const {
  if (grid.kind != GridKind::elevation) return records[cache.lookup(static_cast<std::uint32_t>(grid.nearest(wo)))];
  std::size_t step = 0;
  for (const float cosine : steps) step += wo.z() < cosine ? 1 : 0;
  return records[recordOfStep[step]];
}

BrdfCaches::BrdfCaches(const std::filesystem::path& folder, std::span<const LobeRequest> requests,
                       const std::string& remedy, float reduction) {
  std::map<std::tuple<std::string, std::string, int>, int> known;  // by model, key and revision
  std::map<std::string, std::vector<std::string>> faults;          // message -> materials
  for (const LobeRequest& request : requests) {
    auto [entry, added] =
        known.try_emplace({request.model, request.key, request.revision}, static_cast<int>(caches_.size()));
    cacheOfRequest_.push_back(entry->second);
    if (!added) continue;
    try {
      caches_.emplace_back(openFor(folder, request), reduction);
    } catch (const std::runtime_error& e) {
      faults[e.what()].push_back(request.material);
      known.erase(entry);  // so that other materials with the same lobe are listed as well
    }
  }
  if (faults.empty()) return;
  std::vector<std::string> lines;
  lines.reserve(faults.size());
  for (const auto& [message, materials] : faults)
    lines.push_back(fmt::format("{} (material {})", message, fmt::join(materials, ", ")));
  throw std::runtime_error(fmt::format("BRDF caches: {}; run: {}", fmt::join(lines, "; "), remedy));
}

void BrdfCaches::add(int lobe, const Vec3& wo, const Vec2& turn, float tint, Reflectance& reflectance) const {
  assert(std::isfinite(tint));
  const auto request = static_cast<std::size_t>(lobe);  // huge for negative numbers
  if (request >= cacheOfRequest_.size()) [[unlikely]]
    refuseIndex(lobe, cacheOfRequest_.size());
  const Entry& entry = caches_[cacheOfRequest_[request]];
  const Mirror mirror = entry.cache.info().quarter ? Mirror::intoQuadrant(wo) : Mirror{};
  const Record& record = entry.nearest(mirror(wo));
  const bool representable = record.count > 0 && record.count <= reflectance.gaussians.room();
  (representable ? reflectance.albedo : reflectance.unrepresentableAlbedo) += tint * record.albedo;
  if (!representable) return;

  Placement placement = placementOf({entry.grid.kind, record.reference, mirror}, wo);
  // Compose with the rotation by `turn`: the angles add up.
  const float cosine = placement.cosine, sine = placement.sine;
  placement.cosine = turn.x() * cosine - turn.y() * sine;
  placement.sine = turn.y() * cosine + turn.x() * sine;
  // ρ = integral · G / 2 because dω = 2 dA. G is normalised over the whole plane; Record::integral accounts for that.
  placement.factor = 0.5f * tint * record.integral;
  auto& gaussians = reflectance.gaussians;
  placeMixture(record.view(entry.lanes), placement, gaussians.data(), gaussians.kStride, gaussians.count());
  gaussians.grow(record.count);
  reflectance.backgroundMass += placement.factor * 2.0f * std::numbers::inv_pi_v<float> * record.cosineMass;
}

std::size_t BrdfCaches::bytes() const {
  std::size_t sum = 0;
  for (const Entry& e : caches_) sum += e.cache.bytes();
  return sum;
}

double BrdfCaches::meanComponents() const {
  double sum = 0, count = 0;
  for (const Entry& e : caches_) {
    count += static_cast<double>(e.records.size());
    for (const Record& r : e.records) sum += r.count;
  }
  return count > 0 ? sum / count : 0;
}

std::vector<std::uint64_t> BrdfCaches::hashes() const {
  std::vector<std::uint64_t> all;
  all.reserve(caches_.size());
  for (const Entry& e : caches_) all.push_back(e.cache.hash());
  return all;
}

}  // namespace lobe
