#include "lobe/cache_set.h"

#include "runtime/guiding/brdf_caches.h"

namespace lobe {

LobeCacheSet::LobeCacheSet(const std::filesystem::path& folder, std::span<const LobeRequest> requests,
                           const std::string& remedy, float reduction)
    : caches_(std::make_shared<const BrdfCaches>(folder, requests, remedy, reduction)) {}

std::size_t LobeCacheSet::bytes() const {
  return caches_->bytes();
}

double LobeCacheSet::meanComponents() const {
  return caches_->meanComponents();
}

std::vector<std::uint64_t> LobeCacheSet::hashes() const {
  return caches_->hashes();
}

}  // namespace lobe
