#pragma once
// Checks shared by the readers and writers of all cache files: FlatBuffers and structs that are read in place, and the
// validity of mixtures. A failed check of a reader throws std::runtime_error with the message "NAME: damaged: what is
// wrong".

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include <flatbuffers/flatbuffers.h>

#include "schema/lobe_cache.h"

namespace lobe {

/// Throws the error of a damaged file.
[[noreturn]] void refuseDamaged(const std::string& name, std::string_view fault);

bool allFinite(std::initializer_list<float> values);

/// Throws unless all numbers are finite, weights are not negative, and covariances are positive definite.
void checkComponents(std::span<const CacheComponent> components, const std::string& name);

bool componentsInRange(std::uint32_t first, std::uint32_t count, std::span<const CacheComponent> all);
bool weightsSumToOne(std::span<const CacheComponent> mixture);

/// Throws unless the size and alignment of the payload are valid for a FlatBuffer.
void checkBufferPlace(std::span<const std::byte> payload, const std::string& name);

/// The size to reserve for a FlatBuffer with vectors of so many bytes together. Throws std::runtime_error if they are
/// too many for a file. `what` names the vectors in the message.
std::size_t bufferSize(std::size_t vectors, std::string_view what);

/// Verifies the structure of a payload and returns its root table. `what` names the file type in messages.
template <class Root>
const Root& verifiedBuffer(std::span<const std::byte> payload, const std::string& name, const std::string& what) {
  checkBufferPlace(payload, name);
  const auto* data = reinterpret_cast<const std::uint8_t*>(payload.data());
  flatbuffers::Verifier verifier(data, payload.size());
  if (!verifier.VerifyBuffer<Root>(nullptr)) refuseDamaged(name, "the structure is not that of a " + what);
  return *flatbuffers::GetRoot<Root>(data);
}

/// A view of a FlatBuffers vector of structs or numbers, without copying. Throws unless it is empty or aligned, which
/// the verifier of FlatBuffers checks for its size only.
template <class To, class Element>
std::span<const To> inPlace(const flatbuffers::Vector<Element>& vector, const std::string& name) {
  using From = std::remove_pointer_t<Element>;
  static_assert(sizeof(To) == sizeof(From) && alignof(To) == alignof(From));
  if (vector.size() == 0) return {};
  if (reinterpret_cast<std::uintptr_t>(vector.Data()) % alignof(To) != 0)
    refuseDamaged(name, "a vector is not aligned");
  return {reinterpret_cast<const To*>(vector.Data()), vector.size()};
}

}  // namespace lobe
