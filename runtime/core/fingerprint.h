#pragma once
// A 64-bit hash (XXH3) of values put in one after the other: equal values in equal order give equal fingerprints, on
// every run.

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

  /// Its length and its characters, so that two texts are never mistaken for others that join to the same.
  void text(std::string_view value);

  template <class Number>
  requires std::is_arithmetic_v<Number> || std::is_enum_v<Number>
  void number(Number value) { bytes(std::as_bytes(std::span(&value, 1))); }

  /// The coefficients of a vector, matrix or colour of fixed size.
  template <class Fixed>
  void coefficients(const Fixed& value) {
    bytes(std::as_bytes(std::span(value.data(), static_cast<std::size_t>(value.size()))));
  }

  /// How many there are and what they are, for elements without padding.
  template <class Element>
  void array(std::span<const Element> elements) {
    number(elements.size());
    bytes(std::as_bytes(elements));
  }

  std::uint64_t value() const;

 private:
  struct Deleter {
    void operator()(XXH3_state_s* state) const;
  };
  std::unique_ptr<XXH3_state_s, Deleter> state_;
};

}  // namespace lobe
