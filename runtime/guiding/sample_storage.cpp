#include "lobe/sample_storage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>

#include "runtime/core/parallel.h"
#include "runtime/guiding/conversions.h"
#include "runtime/guiding/sample_storage_data.h"

namespace lobe {
namespace {

using Data = SampleStorageData;

template <class T>
using ListOf = std::vector<T> Data::*;

template <class T>
void appendList(Data& to, std::span<Data* const> others, ListOf<T> list) {
  std::vector<T>& all = to.*list;
  if (others.size() > 1) {
    std::size_t size = all.size();
    for (const Data* other : others) size += (other->*list).size();
    all.reserve(size);
  }
  for (Data* other : others) {
    std::vector<T> more = std::move(other->*list);
    if (all.empty() && others.size() == 1)
      all = std::move(more);
    else
      all.insert(all.end(), more.begin(), more.end());
  }
}

/// The lists of a part that is appended: where its paths go, and the sizes of the lists before.
struct Part {
  std::size_t paths;
  Data::Path before;
};

Data::Path sum(const Data::Path& a, const Data::Path& b) {
  return {b.index, a.photons + b.photons, a.samples + b.samples, a.fractions + b.fractions, a.requests + b.requests};
}

/// Must be called before the other lists are appended.
void appendPaths(Data& to, std::span<Data* const> others) {
  std::vector<Part> parts;
  Part next{to.paths.size(), to.end()};
  for (const Data* other : others) {
    parts.push_back(next);
    next = {next.paths + other->paths.size(), sum(next.before, other->end())};
  }
  to.paths.resize(next.paths);
  parallelFor(std::size_t{0}, others.size(), [&](std::size_t i) {
    const auto out = to.paths.begin() + static_cast<std::ptrdiff_t>(parts[i].paths);
    std::ranges::transform(others[i]->paths, out, [&](const Data::Path& path) { return sum(parts[i].before, path); });
    others[i]->paths = {};
  });
}

/// Copies the elements of one list, path by path in the given order.
template <class T>
void gather(const Data& from, std::span<const std::size_t> order, ListOf<T> list, std::size_t Data::Path::*first,
            Data& to) {
  const std::vector<T>& all = from.*list;
  const auto at = [&](std::size_t path) {
    return all.begin() + static_cast<std::ptrdiff_t>(path < from.paths.size() ? from.paths[path].*first : all.size());
  };
  (to.*list).reserve(all.size());
  for (const std::size_t i : order) (to.*list).insert((to.*list).end(), at(i), at(i + 1));
}

/// Calls f(list, member of Path) for each of the lists in parallel.
template <class Function>
void forEachList(const Function& f) {
  const std::array<std::function<void()>, 4> calls{
      [&] { f(&Data::photons, &Data::Path::photons); }, [&] { f(&Data::samples, &Data::Path::samples); },
      [&] { f(&Data::fractions, &Data::Path::fractions); }, [&] { f(&Data::requests, &Data::Path::requests); }};
  parallelFor(std::size_t{0}, calls.size(), [&](std::size_t i) { calls[i](); });
}

}  // namespace

void SampleStorageData::beginPath(std::uint64_t index) {
  Path path = end();
  path.index = index;
  const bool lastIsEmpty = !paths.empty() && photons.size() == paths.back().photons &&
                           samples.size() == paths.back().samples && fractions.size() == paths.back().fractions &&
                           requests.size() == paths.back().requests;
  if (lastIsEmpty)
    paths.back() = path;
  else
    paths.push_back(path);
}

void SampleStorageData::append(std::span<SampleStorageData* const> others) {
  appendPaths(*this, others);
  forEachList([&](auto list, auto) { appendList(*this, others, list); });
}

bool SampleStorageData::isInOrder() const {
  return std::ranges::is_sorted(paths, {}, &Path::index);
}

SampleStorageData SampleStorageData::inOrder() const {
  std::vector<std::size_t> order(paths.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [this](std::size_t i) { return paths[i].index; });
  SampleStorageData sorted;
  forEachList([&](auto list, auto first) { gather(*this, order, list, first, sorted); });
  Path at{};
  for (const std::size_t i : order) {
    const Path& path = paths[i];
    const Path next = i + 1 < paths.size() ? paths[i + 1] : end();
    at.index = path.index;
    sorted.paths.push_back(at);
    at = {0, at.photons + next.photons - path.photons, at.samples + next.samples - path.samples,
          at.fractions + next.fractions - path.fractions, at.requests + next.requests - path.requests};
  }
  return sorted;
}

SampleStorage::SampleStorage() : data_(std::make_unique<SampleStorageData>()) {}
SampleStorage::~SampleStorage() = default;
SampleStorage::SampleStorage(SampleStorage&& other) noexcept = default;
SampleStorage& SampleStorage::operator=(SampleStorage&& other) noexcept = default;

void SampleStorage::beginPath(std::uint64_t index) {
  data_->beginPath(index);
}

void SampleStorage::addPhoton(const Float3& position, const Float3& normal, const Float3& direction, float weight,
                              float distance, float flux) {
  const bool usable = std::isfinite(weight) && weight >= 0 && std::isfinite(flux) && flux >= 0;
  if (!usable || !isFinite(position) || !isFinite(normal) || !isFinite(direction)) return;
  data_->photons.push_back({toEigen(position), toEigen(normal), toEigen(direction), weight, distance, flux});
}

void SampleStorage::requestRecord(const ShadingPoint& point) {
  requestRecord(point.position, toFloats(Vec3(sideOf(point) * toEigen(point.normal))));
}

void SampleStorage::requestRecord(const Float3& position, const Float3& normal) {
  const Vec3 n = toEigen(normal);
  const float length = n.norm();  // not finite if n is not
  if (isFinite(position) && length > 0 && std::isfinite(length))
    data_->requests.push_back({toEigen(position), n / length});
}

void SampleStorage::merge(SampleStorage&& other) {
  merge(std::span(&other, 1));
}

void SampleStorage::merge(std::span<SampleStorage> others) {
  try {
    std::vector<SampleStorageData*> data;
    for (SampleStorage& other : others)
      if (&other != this) data.push_back(other.data_.get());
    isolated([&] { data_->append(data); });
  } catch (...) {
    // The paths may refer to samples that have not been appended.
    clear();
    for (SampleStorage& other : others) other.clear();
    throw;
  }
}

std::size_t SampleStorage::particles() const {
  return data_->photons.size() + data_->samples.size();
}

const SampleStorageData& dataOf(const SampleStorage& storage) {
  return *storage.data_;
}

void SampleStorage::clear() {
  *data_ = {};
}

}  // namespace lobe
