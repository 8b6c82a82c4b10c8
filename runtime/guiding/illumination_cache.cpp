#include "runtime/guiding/illumination_cache.h"

#include <algorithm>
#include <bit>
#include <new>
#include <numeric>

#include "runtime/core/parallel.h"
#include "runtime/mixture/packing.h"

namespace lobe {
namespace {

constexpr float kMinNormalCosine = 0.97f;  // about 14°
// A cell is twice as large as the largest radius, so that a record overlaps few cells and a cell holds few records.
constexpr float kCellsPerUnit = 0.5f;
constexpr float kRounding = 1e-3f;  // in cells: rounding may place a point into the cell next to its own

/// The cell of a point given in cells. Points that are too far away for integers are placed into the outermost cells;
/// records and look-ups there lose nothing, because single precision does not resolve a cell at such a distance.
Eigen::Vector3i cellOf(const Vec3& x) {
  constexpr float kOutermost = 1 << 30;
  return x.array().floor().max(-kOutermost).min(kOutermost).cast<int>();
}

/// Every cell holds records of one side only: the face of the direction cube that their normal points at.
enum Side : std::uint8_t { kSides = 6 };

Side sideOf(const Vec3& n) {
  Eigen::Index axis;
  n.cwiseAbs().maxCoeff(&axis);
  return static_cast<Side>(2 * axis + (n[axis] < 0));
}

/// Whether a record with normal n may serve points whose normal points at this side.
bool mayServe(const Vec3& n, Side side) {
  // Two unit vectors within the allowed angle differ by a chord of bounded length, which changes the difference of two
  // coordinates by up to √2 times that length.
  const float most = std::sqrt(2 * 2 * (1 - kMinNormalCosine)) + kRounding;
  const float along = side % 2 == 0 ? n[side / 2] : -n[side / 2];
  return along + most >= n.cwiseAbs().maxCoeff();
}

std::uint64_t cellKey(const Eigen::Vector3i& cell, Side side) {
  // 20 bits per axis. In a scene of more than 2^20 cells per axis keys wrap around and distant cells share a key, which
  // is harmless because find tests distances.
  constexpr std::uint64_t mask = (1u << 20) - 1;
  return (static_cast<std::uint64_t>(cell.x()) & mask) | (static_cast<std::uint64_t>(cell.y()) & mask) << 20 |
         (static_cast<std::uint64_t>(cell.z()) & mask) << 40 | static_cast<std::uint64_t>(side) << 60;
}

std::size_t slotOf(std::uint64_t key, std::size_t tableSize) {
  return (key * 0x9e3779b97f4a7c15ull) >> (64 - std::countr_zero(tableSize));
}

// The Gaussians are needed only after the reflectance has been looked up; prefetching hides the latency.
void prefetch(const PackedRecord& record) {
  constexpr int kLine = 64;
  const auto* bytes = reinterpret_cast<const char*>(&record);
  // For the largest record, of 8 Gaussians: reading the actual count would wait for the memory access.
  constexpr int kBytes = static_cast<int>(sizeof(PackedRecord)) + kGaussianFields * kMaxLightComponents * 4;
  for (int i = 0; i < kBytes; i += kLine) __builtin_prefetch(bytes + i);
}

}  // namespace

IlluminationCache::IlluminationCache(const std::vector<IlluminationRecord>& records, float unit)
    : unit_(unit), inverseCellSize_(kCellsPerUnit / unit) {
  std::uint32_t block = 0;
  for (const IlluminationRecord& r : records) {
    places_.push_back({r.position, r.normal, r.radius, r.likelihoodGain, block});
    block += static_cast<std::uint32_t>((PackedRecord::bytesFor(r.count) + sizeof(Block) - 1) / sizeof(Block));
  }
  blocks_.resize(block);
  parallelFor(std::size_t{0}, records.size(), [&](std::size_t i) { pack(records[i], i); });
  const std::vector<Placement> placements = placeInCells();
  std::vector<Cell> cells;
  for (std::uint32_t i = 0; i < placements.size(); ++i) {
    if (cells.empty() || cells.back().key != placements[i].key) cells.push_back({placements[i].key, i, i});
    ++cells.back().end;
  }
  entries_.resize(placements.size());
  parallelFor(std::size_t{0}, placements.size(), [&](std::size_t i) {
    const Place& r = places_[placements[i].record];
    entries_[i] = {r.position, r.normal, r.radius * r.radius, r.block};
  });
  table_.assign(std::bit_ceil(2 * cells.size() + 2), Cell{0, 0, 0});
  for (const Cell& cell : cells) {
    std::size_t slot = slotOf(cell.key, table_.size());
    while (table_[slot].begin != table_[slot].end) slot = (slot + 1) & (table_.size() - 1);
    table_[slot] = cell;
  }
}

template <class Visit>
void IlluminationCache::forEachKey(const Place& r, const Visit& visit) const {
  const Vec3 centre = r.position * inverseCellSize_;  // in cells
  const float radius = r.radius * inverseCellSize_ + kRounding;
  const Eigen::Vector3i low = cellOf(centre.array() - radius), high = cellOf(centre.array() + radius);
  for (int z = low.z(); z <= high.z(); ++z)
    for (int y = low.y(); y <= high.y(); ++y)
      for (int x = low.x(); x <= high.x(); ++x) {
        const Vec3 corner(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z));
        const Eigen::AlignedBox3f cell(corner, corner + Vec3::Ones());
        if (cell.squaredExteriorDistance(centre) > radius * radius) continue;
        for (int side = 0; side < kSides; ++side)
          if (mayServe(r.normal, static_cast<Side>(side))) visit(cellKey({x, y, z}, static_cast<Side>(side)));
      }
}

std::vector<IlluminationCache::Placement> IlluminationCache::placeInCells() const {
  // The first placement of each record is known only after those of all earlier ones have been counted.
  std::vector<std::size_t> ends(places_.size());
  parallelFor(std::size_t{0}, places_.size(), [&](std::size_t i) {
    std::size_t count = 0;
    forEachKey(places_[i], [&](std::uint64_t) { ++count; });
    ends[i] = count;
  });
  std::partial_sum(ends.begin(), ends.end(), ends.begin());
  std::vector<Placement> placements(ends.empty() ? 0 : ends.back());
  parallelFor(std::size_t{0}, places_.size(), [&](std::size_t i) {
    std::size_t next = i > 0 ? ends[i - 1] : 0;
    forEachKey(places_[i], [&](std::uint64_t key) { placements[next++] = {key, static_cast<std::uint32_t>(i)}; });
  });
  parallelSort(placements, [](const Placement& a, const Placement& b) {
    return a.key != b.key ? a.key < b.key : a.record < b.record;
  });
  return placements;
}

void IlluminationCache::pack(const IlluminationRecord& record, std::size_t index) {
  static_assert(sizeof(PackedRecord) == sizeof(Block) && kMaxLightComponents == 8);
  const std::size_t first = places_[index].block;
  new (&blocks_[first]) PackedRecord{.tangentXyz = {record.tangent.x(), record.tangent.y(), record.tangent.z()},
                                     .background = record.background,
                                     .irradiance = record.irradiance,
                                     .samples = record.samples,
                                     .bsdfFraction = record.bsdfFraction,
                                     .count = static_cast<std::uint32_t>(record.count) & 0xfu,
                                     .index = static_cast<std::uint32_t>(index) & 0xfffffffu};
  packGaussians(record.gaussians(), blocks_[first + 1].floats.data(), PackedRecord::strideFor(record.count));
}

IlluminationRecord IlluminationCache::unpacked(const PackedRecord& record) const {
  const Place& place = places_[record.index];
  IlluminationRecord r{.position = place.position,
                       .normal = place.normal,
                       .tangent = record.tangent(),
                       .radius = place.radius,
                       .background = record.background,
                       .irradiance = record.irradiance,
                       .samples = record.samples,
                       .bsdfFraction = record.bsdfFraction,
                       .likelihoodGain = place.likelihoodGain,
                       .count = static_cast<std::int32_t>(record.count),
                       .components = {}};
  std::ranges::copy(unpackGaussians(record.gaussians()), r.components.begin());
  return r;
}

std::vector<IlluminationRecord> IlluminationCache::records() const {
  std::vector<IlluminationRecord> all;
  all.reserve(places_.size());
  for (const Place& place : places_) all.push_back(unpacked(at(place.block)));
  return all;
}

double IlluminationCache::meanComponents() const {
  double sum = 0;
  for (const Place& place : places_) sum += at(place.block).count;
  return places_.empty() ? 0 : sum / static_cast<double>(places_.size());
}

IlluminationCache reduced(const IlluminationCache& cache, float threshold) {
  std::vector<IlluminationRecord> records = cache.records();
  for (IlluminationRecord& r : records) {
    Mixture mixture(r.gaussians().begin(), r.gaussians().end());
    reduce(mixture, threshold);
    r.count = static_cast<std::int32_t>(mixture.size());
    std::ranges::copy(mixture, r.components.begin());
  }
  return {records, cache.unit()};
}

const IlluminationCache::Cell* IlluminationCache::findCell(std::uint64_t key) const {
  if (table_.empty()) return nullptr;
  for (std::size_t slot = slotOf(key, table_.size());; slot = (slot + 1) & (table_.size() - 1)) {
    const Cell& cell = table_[slot];
    if (cell.begin == cell.end) return nullptr;
    if (cell.key == key) return &cell;
  }
}

const PackedRecord* IlluminationCache::find(const Vec3& x, const Vec3& n) const {
  const Cell* cell = findCell(cellKey(cellOf(x * inverseCellSize_), sideOf(n)));
  if (!cell) return nullptr;
  const Entry* best = nullptr;
  float bestCost = std::numeric_limits<float>::infinity();
  for (std::uint32_t i = cell->begin; i < cell->end; ++i) {
    const Entry& e = entries_[i];
    const float distance2 = (x - e.position).squaredNorm();
    const float cosine = n.dot(e.normal);
    if (distance2 > e.radius2 || cosine < kMinNormalCosine) continue;
    const float cost = std::sqrt(distance2) / unit_ + 2.0f * std::sqrt(std::max(0.0f, 1.001f - cosine));
    if (cost < bestCost) {
      bestCost = cost;
      best = &e;
    }
  }
  if (!best) return nullptr;
  const PackedRecord& found = at(best->block);
  prefetch(found);
  return &found;
}

std::size_t IlluminationCache::bytes() const {
  return places_.size() * sizeof(Place) + blocks_.size() * sizeof(Block) + entries_.size() * sizeof(Entry) +
         table_.size() * sizeof(Cell);
}

}  // namespace lobe
