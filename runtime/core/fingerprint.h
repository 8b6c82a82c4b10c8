#pragma once
// A 64-bit hash (XXH3) of a sequence of values. Equal sequences give equal fingerprints in all runs of the program.

#include <concepts>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <type_traits>

struct XXH3_state_s;

namespace lobe {

class Fingerprint {
 public:
  Fingerprint();
  ~Fingerprint();
  Fingerprint(const Fingerprint&) = delete;
  Fingerprint& operator=(const Fingerprint&) = delete;

  void bytes(std::span<const std::byte> data);

  /// Adds length and characters, so that different sequences of texts with equal concatenation differ.
  void text(std::string_view value);

  template <class Number>
  requires std::is_arithmetic_v<Number> || std::is_enum_v<Number>
  void number(Number value) { bytes(std::as_bytes(std::span(&value, 1))); }

  /// Adds the coefficients of a fixed-size vector, matrix or colour.
  template <class Fixed>
  void coefficients(const Fixed& value) {
    bytes(std::as_bytes(std::span(value.data(), static_cast<std::size_t>(value.size()))));
  }

  /// Adds the number of elements and their bytes. Element must not contain padding bytes.
  template <class Element>
  void array(std::span<const Element> elements) {
    number(elements.size());
    bytes(std::as_bytes(elements));
  }

  /// The hash of all values added so far.
  std::uint64_t value() const;

 private:
  struct Deleter {
    void operator()(XXH3_state_s* state) const;
  };
  std::unique_ptr<XXH3_state_s, Deleter> state_;
};

}  // namespace lobe
