#include "lobe/sample_storage.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "runtime/guiding/conversions.h"
#include "runtime/guiding/sample_storage_data.h"

namespace lobe {
namespace {

template <class T>
void appendRange(std::vector<T>& to, const std::vector<T>& from, std::size_t begin, std::size_t end) {
  to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(begin),
            from.begin() + static_cast<std::ptrdiff_t>(end));
}

}  // namespace

void SampleStorageData::append(const SampleStorageData& other) {
  for (const Path& path : other.paths)
    paths.push_back({path.index, photons.size() + path.photons, samples.size() + path.samples,
                     fractions.size() + path.fractions, requests.size() + path.requests});
  photons.insert(photons.end(), other.photons.begin(), other.photons.end());
  samples.insert(samples.end(), other.samples.begin(), other.samples.end());
  fractions.insert(fractions.end(), other.fractions.begin(), other.fractions.end());
  requests.insert(requests.end(), other.requests.begin(), other.requests.end());
}

bool SampleStorageData::isInOrder() const {
  return std::ranges::is_sorted(paths, {}, &Path::index);
}

SampleStorageData SampleStorageData::inOrder() const {
  std::vector<std::size_t> order(paths.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [this](std::size_t i) { return paths[i].index; });
  const Path end{0, photons.size(), samples.size(), fractions.size(), requests.size()};
  SampleStorageData sorted;
  for (const std::size_t i : order) {
    const Path& path = paths[i];
    const Path& next = i + 1 < paths.size() ? paths[i + 1] : end;
    sorted.beginPath(path.index);
    appendRange(sorted.photons, photons, path.photons, next.photons);
    appendRange(sorted.samples, samples, path.samples, next.samples);
    appendRange(sorted.fractions, fractions, path.fractions, next.fractions);
    appendRange(sorted.requests, requests, path.requests, next.requests);
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
  const auto finite = [](const Float3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); };
  const bool usable = std::isfinite(weight) && weight >= 0 && std::isfinite(flux) && flux >= 0 && distance >= 0;
  if (!usable || !finite(position) || !finite(normal) || !finite(direction)) return;
  data_->photons.push_back({toEigen(position), toEigen(normal), toEigen(direction), weight, distance, flux});
}

void SampleStorage::requestRecord(const Float3& position, const Float3& normal) {
  data_->requests.push_back({toEigen(position), toEigen(normal)});
}

void SampleStorage::merge(SampleStorage&& other) {
  if (data_->paths.empty())
    std::swap(data_, other.data_);
  else
    data_->append(*other.data_);
  other.clear();
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
