#pragma once
// What all cache files have in common besides their container: buffers and structs read in place, and mixtures that
// have to make sense. Faults throw std::runtime_error, "NAME: damaged: what is wrong".

#include <initializer_list>
#include <span>
#include <string>
#include <string_view>

#include <flatbuffers/flatbuffers.h>

#include "schema/lobe_cache.h"

namespace lobe {

[[noreturn]] void refuseDamaged(const std::string& name, std::string_view fault);

bool allFinite(std::initializer_list<float> values);

/// Finite numbers, weights that are not negative, positive definite covariances.
void checkComponents(std::span<const CacheComponent> components, const std::string& name);

bool componentsInRange(std::uint32_t first, std::uint32_t count, std::span<const CacheComponent> all);
bool weightsSumToOne(std::span<const CacheComponent> mixture);

/// Throws unless a FlatBuffer of this size may begin there.
void checkBufferPlace(std::span<const std::byte> payload, const std::string& name);

/// The table at the root of a payload, its structure verified. what: for messages.
template <class Root>
const Root& verifiedBuffer(std::span<const std::byte> payload, const std::string& name, const std::string& what) {
  checkBufferPlace(payload, name);
  const auto* data = reinterpret_cast<const std::uint8_t*>(payload.data());
  flatbuffers::Verifier verifier(data, payload.size());
  if (!verifier.VerifyBuffer<Root>(nullptr)) refuseDamaged(name, "the structure is not that of a " + what);
  return *flatbuffers::GetRoot<Root>(data);
}

/// The elements of a vector of structs where they lie.
template <class To, class From>
std::span<const To> inPlace(const flatbuffers::Vector<const From*>& vector) {
  static_assert(sizeof(To) == sizeof(From) && alignof(To) == alignof(From));
  return {reinterpret_cast<const To*>(vector.Data()), vector.size()};
}

}  // namespace lobe
