#include "scenes/meshes/obj_lines.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

namespace lobe {
namespace {

constexpr std::string_view kBlanks = " \t";

bool isLineEnd(char c) {
  return c == '\n' || c == '\r';
}

}  // namespace

ObjLines::ObjLines(std::string_view text) : text_(text) {
  if (text_.starts_with("\xef\xbb\xbf")) text_.remove_prefix(3);
}

std::optional<std::string_view> ObjLines::next() {
  if (begin_ >= text_.size()) return std::nullopt;
  position_ = begin_;
  number_ = nextNumber_++;
  std::string_view line = takePhysical(begin_);
  if (!line.ends_with('\\')) return line;
  joined_.clear();
  while (line.ends_with('\\')) {
    joined_.append(line.substr(0, line.size() - 1)) += ' ';
    line = takePhysical(begin_);
    ++nextNumber_;
  }
  return joined_ += line;
}

std::string_view ObjLines::takePhysical(std::size_t& begin) const {
  const auto first = text_.begin() + static_cast<std::ptrdiff_t>(begin);
  const auto end = static_cast<std::size_t>(std::find_if(first, text_.end(), isLineEnd) - text_.begin());
  const std::string_view line = text_.substr(begin, end - begin);
  begin = std::min(end + (text_.substr(end, 2) == "\r\n" ? 2 : 1), text_.size());
  return line;
}

std::string ObjLines::describe(std::size_t position, std::string_view message) const {
  std::size_t number = 1;
  for (std::size_t i = 0; i < position; ++i)
    if (text_[i] == '\n' || (text_[i] == '\r' && text_.substr(i + 1, 1) != "\n")) ++number;
  return describe(number, position, message);
}

std::string ObjLines::describe(std::size_t number, std::size_t position, std::string_view message) const {
  constexpr std::size_t kLongest = 60;
  const std::string_view line = takePhysical(position);
  std::string shown(line.substr(0, kLongest));
  for (char& c : shown)
    if (static_cast<unsigned char>(c) < ' ') c = ' ';
  return fmt::format("line {}: {}: \"{}{}\"", number, message, shown, line.size() > kLongest ? "..." : "");
}

std::string_view takeWord(std::string_view& line) {
  line.remove_prefix(std::min(line.find_first_not_of(kBlanks), line.size()));
  const std::string_view word = line.substr(0, line.find_first_of(kBlanks));
  line.remove_prefix(word.size());
  return word;
}

}  // namespace lobe
