#include "runtime/core/printable.h"

#include <algorithm>
#include <bit>
#include <cstddef>

namespace lobe {
namespace {

/// The number of bytes of the character at the start of the text, which is not empty; 0 if it is not UTF-8.
std::size_t lengthOfCharacter(std::string_view text) {
  constexpr std::size_t kLongest = 4;
  const auto ones = static_cast<std::size_t>(std::countl_one(static_cast<unsigned char>(text.front())));
  if (ones == 0) return 1;
  if (ones == 1 || ones > kLongest || ones > text.size()) return 0;
  const auto continues = [](char c) { return std::countl_one(static_cast<unsigned char>(c)) == 1; };
  return std::ranges::all_of(text.substr(1, ones - 1), continues) ? ones : 0;
}

bool isPrintable(std::string_view character) {
  const auto first = static_cast<unsigned char>(character.front());
  if (character.size() == 1) return first >= ' ' && first < 0x7f;
  // 0xc0 and 0xc1 begin no character. U+0080 to U+009F begin with 0xc2.
  return first > 0xc2 || (first == 0xc2 && static_cast<unsigned char>(character[1]) >= 0xa0);
}

}  // namespace

std::string printable(std::string_view text) {
  std::string shown;
  while (!text.empty()) {
    const std::size_t length = std::max<std::size_t>(1, lengthOfCharacter(text));
    const std::string_view character = text.substr(0, length);
    shown += isPrintable(character) ? character : "?";
    text.remove_prefix(length);
  }
  return shown;
}

}  // namespace lobe
