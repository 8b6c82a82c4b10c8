#include "runtime/core/fingerprint.h"

#include <new>

#include <xxhash.h>

namespace lobe {

void Fingerprint::Deleter::operator()(XXH3_state_s* state) const {
  XXH3_freeState(state);
}

Fingerprint::Fingerprint() : state_(XXH3_createState()) {
  if (!state_) throw std::bad_alloc();
  XXH3_64bits_reset(state_.get());
}

Fingerprint::~Fingerprint() = default;

void Fingerprint::bytes(std::span<const std::byte> data) {
  XXH3_64bits_update(state_.get(), data.data(), data.size());
}

void Fingerprint::text(std::string_view value) {
  array(std::span(value));
}

std::uint64_t Fingerprint::value() const {
  return XXH3_64bits_digest(state_.get());
}

}  // namespace lobe
