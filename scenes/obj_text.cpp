#include "scenes/obj_text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

namespace lobe {
namespace {

constexpr int kNone = ObjData::kNone;
constexpr int kTooLarge = std::numeric_limits<int>::max();

bool isBlank(char c) {
  return c == ' ' || c == '\t';
}

bool isLineEnd(char c) {
  return c == '\n' || c == '\r';
}

/// Takes the next word off the line; empty at its end.
std::string_view takeWord(std::string_view& line) {
  std::size_t begin = 0;
  while (begin < line.size() && isBlank(line[begin])) ++begin;
  std::size_t end = begin;
  while (end < line.size() && !isBlank(line[end])) ++end;
  const std::string_view word = line.substr(begin, end - begin);
  line.remove_prefix(end);
  return word;
}

/// What is too small becomes zero, what is too large infinite.
bool parseFloat(std::string_view word, float& value) {
  if (word.starts_with('+')) word.remove_prefix(1);
  double wide = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), wide);
  if (word.empty() || end != word.data() + word.size() || error == std::errc::invalid_argument) return false;
  if (error == std::errc::result_out_of_range)
    wide = word.find("e-") != std::string_view::npos || word.find("E-") != std::string_view::npos ? 0 : INFINITY;
  value = static_cast<float>(wide);
  return true;
}

/// One of a corner's numbers, up to the next slash, which is taken along; nothing is 0. What overflows is kTooLarge.
bool takeIndex(std::string_view& word, int& index) {
  const std::string_view digits = word.substr(0, word.find('/'));
  word.remove_prefix(std::min(digits.size() + 1, word.size()));
  index = 0;
  if (digits.empty()) return true;
  const std::size_t sign = digits.starts_with('+') ? 1 : 0;
  const auto [end, error] = std::from_chars(digits.data() + sign, digits.data() + digits.size(), index);
  if (error == std::errc::result_out_of_range) index = kTooLarge;
  return error != std::errc::invalid_argument && end == digits.data() + digits.size();
}

/// OBJ counts from 1, or backwards from the latest by negative numbers. What is before the first is kTooLarge.
int resolve(int index, std::size_t count) {
  if (index == 0) return kNone;
  if (index == kTooLarge || index > 0) return index == kTooLarge ? kTooLarge : index - 1;
  const long resolved = static_cast<long>(count) + index;
  return resolved >= 0 ? static_cast<int>(resolved) : kTooLarge;
}

class ObjParser {
 public:
  ObjParser(std::string_view text, const std::vector<std::string>& materials)
      : text_(text), materials_(materials), part_(static_cast<int>(materials.size())) {}

  ObjData parse() {
    if (text_.starts_with("\xef\xbb\xbf")) text_.remove_prefix(3);
    for (std::size_t begin = 0; begin < text_.size();) {
      line_ = begin;
      readLine(takeLine(begin));
    }
    checkIndices();
    return std::move(data_);
  }

 private:
  /// The line from begin on, without its end, which begin is moved past. Joined lines stay in joined_.
  std::string_view takeLine(std::size_t& begin) {
    std::string_view line = takePhysicalLine(begin);
    if (!line.ends_with('\\')) return line;
    joined_.clear();
    while (line.ends_with('\\')) {
      joined_.append(line.substr(0, line.size() - 1)) += ' ';
      line = takePhysicalLine(begin);
    }
    return joined_ += line;
  }

  std::string_view takePhysicalLine(std::size_t& begin) const {
    std::size_t end = begin;
    while (end < text_.size() && !isLineEnd(text_[end])) ++end;
    const std::string_view line = text_.substr(begin, end - begin);
    begin = std::min(end + (text_.substr(end, 2) == "\r\n" ? 2 : 1), text_.size());
    return line;
  }

  void readLine(std::string_view line) {
    std::string_view rest = line;
    const std::string_view key = takeWord(rest);
    if (key == "usemtl") return readMaterial(rest);
    rest = rest.substr(0, rest.find('#'));
    if (key == "v")
      readPosition(rest);
    else if (key == "vn")
      readNormal(rest);
    else if (key == "vt")
      readUv(rest);
    else if (key == "f")
      readFace(rest);
  }

  void readMaterial(std::string_view name) {
    while (!name.empty() && isBlank(name.front())) name.remove_prefix(1);
    while (!name.empty() && isBlank(name.back())) name.remove_suffix(1);
    part_ = static_cast<int>(std::ranges::find(materials_, name) - materials_.begin());
  }

  /// The first three numbers, of which so many are needed; what is not there is zero. All words must be numbers.
  Vec3 readNumbers(std::string_view rest, int needed) {
    Vec3 numbers = Vec3::Zero();
    int count = 0;
    for (std::string_view word = takeWord(rest); !word.empty(); word = takeWord(rest), ++count) {
      float value = 0;
      if (!parseFloat(word, value)) fail(line_, fmt::format("\"{}\" is not a number", word));
      if (count < 3) numbers[count] = value;
    }
    if (count < needed) fail(line_, fmt::format("{} numbers are needed", needed));
    return numbers;
  }

  void readPosition(std::string_view rest) {
    const Vec3 position = readNumbers(rest, 3);
    if (!position.allFinite()) fail(line_, "not a finite number");
    data_.positions.push_back(position);
  }

  void readNormal(std::string_view rest) {
    data_.normals.push_back(readNumbers(rest, 3));
    anyBadNormal_ = anyBadNormal_ || !data_.normals.back().allFinite();
  }

  void readUv(std::string_view rest) {
    const Vec3 uv = readNumbers(rest, 1);
    // Textures have v downwards, the file upwards.
    data_.uvs.push_back(uv.allFinite() ? Vec2(uv.x(), 1.0f - uv.y()) : Vec2(0, 0));
  }

  void readFace(std::string_view rest) {
    for (std::string_view word = takeWord(rest); !word.empty(); word = takeWord(rest)) {
      int position = 0, uv = 0, normal = 0;
      std::string_view left = word;
      if (!takeIndex(left, position) || !takeIndex(left, uv) || !takeIndex(left, normal) || !left.empty())
        fail(line_, fmt::format("\"{}\" is not a corner such as 1, 1/2, 1//3 or 1/2/3", word));
      data_.corners.push_back({resolve(position, data_.positions.size()), resolve(uv, data_.uvs.size()),
                               resolve(normal, data_.normals.size())});
    }
    if (data_.corners.size() - data_.faceEnds.back() < 3) fail(line_, "a face needs three corners or more");
    data_.faceEnds.push_back(data_.corners.size());
    data_.faceParts.push_back(part_);
    faceLines_.push_back(line_);
  }

  /// Only at the end, as a face may come before its vertices.
  void checkIndices() {
    for (std::size_t face = 0; face < faceLines_.size(); ++face)
      for (std::size_t i = data_.faceEnds[face]; i < data_.faceEnds[face + 1]; ++i)
        checkCorner(data_.corners[i], faceLines_[face]);
  }

  void checkCorner(ObjData::Corner& corner, std::size_t line) const {
    const auto check = [&](int index, std::size_t count, const char* what) {
      if (index == kNone || static_cast<std::size_t>(index) >= count)
        fail(line, fmt::format("a face refers to a {} that is not there (there are {})", what, count));
    };
    check(corner.position, data_.positions.size(), "vertex");
    if (corner.uv != kNone) check(corner.uv, data_.uvs.size(), "texture coordinate");
    if (corner.normal != kNone) check(corner.normal, data_.normals.size(), "normal");
    if (anyBadNormal_ && corner.normal != kNone && !data_.normals[corner.normal].allFinite()) corner.normal = kNone;
  }

  [[noreturn]] void fail(std::size_t begin, std::string_view message) const {
    std::size_t number = 1;
    for (std::size_t i = 0; i < begin; ++i)
      if (text_[i] == '\n' || (text_[i] == '\r' && text_.substr(i + 1, 1) != "\n")) ++number;
    constexpr std::size_t kLongest = 60;
    const std::string_view line = takePhysicalLine(begin);
    std::string shown(line.substr(0, kLongest));
    for (char& c : shown)
      if (static_cast<unsigned char>(c) < ' ') c = ' ';
    throw std::runtime_error(
        fmt::format("line {}: {}: \"{}{}\"", number, message, shown, line.size() > kLongest ? "..." : ""));
  }

  std::string_view text_;
  const std::vector<std::string>& materials_;
  ObjData data_;
  std::vector<std::size_t> faceLines_;  // where they begin
  std::string joined_;
  std::size_t line_ = 0;  // where the present one begins
  int part_;              // of the faces to come
  bool anyBadNormal_ = false;
};

}  // namespace

ObjData parseObj(std::string_view text, const std::vector<std::string>& materials) {
  return ObjParser(text, materials).parse();
}

}  // namespace lobe
