#include "scenes/meshes/obj_text.h"

#include <algorithm>
#include <charconv>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "runtime/core/numbers.h"
#include "scenes/meshes/obj_lines.h"

namespace lobe {
namespace {

constexpr int kNone = ObjData::kNone;
constexpr int kTooLarge = std::numeric_limits<int>::max();

/// Parses one index of a corner up to the next slash, which is consumed. A missing index is 0, one that overflows
/// kTooLarge.
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

/// OBJ indices count from 1, or backwards from the latest element if negative. An index before the first element is
/// kTooLarge.
int resolve(int index, std::size_t count) {
  if (index == 0) return kNone;
  if (index == kTooLarge || index > 0) return index == kTooLarge ? kTooLarge : index - 1;
  const long resolved = static_cast<long>(count) + index;
  return resolved >= 0 ? static_cast<int>(resolved) : kTooLarge;
}

/// Tracks `g` and `usemtl` through a file. As in Mitsuba 0.6, they end a mesh that has faces; `o` does not.
class ObjParts {
 public:
  /// Returns whether the line was one of the two. rest: the line after its key.
  bool take(std::string_view key, std::string_view rest) {
    if (key != "g" && key != "usemtl") return false;
    if (hasFaces_) ++mesh_;
    hasFaces_ = false;
    if (key == "usemtl") material_ = trimmed(rest);
    return true;
  }
  void addFace() { hasFaces_ = true; }
  int mesh() const { return mesh_; }
  const std::string& material() const { return material_; }

 private:
  int mesh_ = 0;
  bool hasFaces_ = false;
  std::string material_;
};

class ObjParser {
 public:
  explicit ObjParser(std::string_view text) : lines_(text) {}

  ObjData parse() {
    while (const std::optional<std::string_view> line = lines_.next()) readLine(*line);
    checkIndices();
    data_.lastMaterial = material_;
    return std::move(data_);
  }

 private:
  void readLine(std::string_view line) {
    std::string_view rest = line;
    const std::string_view key = takeWord(rest);
    if (parts_.take(key, rest)) return setMaterial();
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

  void setMaterial() {
    const auto [entry, isNew] = materialIds_.try_emplace(parts_.material(), static_cast<int>(data_.materials.size()));
    if (isNew) data_.materials.push_back(parts_.material());
    material_ = entry->second;
  }

  /// The first three numbers of the line, of which the first `needed` are required; missing ones are zero. All words
  /// must be numbers.
  Vec3 readNumbers(std::string_view rest, int needed) {
    Vec3 numbers = Vec3::Zero();
    int count = 0;
    for (std::string_view word = takeWord(rest); !word.empty(); word = takeWord(rest), ++count) {
      const std::optional<double> value = parseReal(word);
      if (!value) fail(lines_.position(), fmt::format("\"{}\" is not a number", word));
      if (count < 3) numbers[count] = static_cast<float>(*value);
    }
    if (count < needed) fail(lines_.position(), fmt::format("{} numbers are required", needed));
    return numbers;
  }

  void readPosition(std::string_view rest) {
    const Vec3 position = readNumbers(rest, 3);
    if (!position.allFinite()) fail(lines_.position(), "not a finite number");
    data_.positions.push_back(position);
  }

  void readNormal(std::string_view rest) {
    data_.normals.push_back(readNumbers(rest, 3));
    anyBadNormal_ = anyBadNormal_ || !data_.normals.back().allFinite();
  }

  void readUv(std::string_view rest) {
    const Vec3 uv = readNumbers(rest, 1);
    // Textures have v downwards, OBJ files upwards.
    data_.uvs.push_back(uv.allFinite() ? Vec2(uv.x(), 1.0f - uv.y()) : Vec2(0, 0));
  }

  void readFace(std::string_view rest) {
    const std::size_t begin = data_.corners.size();
    for (std::string_view word = takeWord(rest); !word.empty(); word = takeWord(rest)) {
      int position = 0, uv = 0, normal = 0;
      std::string_view left = word;
      if (!takeIndex(left, position) || !takeIndex(left, uv) || !takeIndex(left, normal) || !left.empty())
        fail(lines_.position(), fmt::format("\"{}\" is not a corner such as 1, 1/2, 1//3 or 1/2/3", word));
      data_.corners.push_back({resolve(position, data_.positions.size()), resolve(uv, data_.uvs.size()),
                               resolve(normal, data_.normals.size())});
    }
    if (data_.corners.size() - begin < 3) fail(lines_.position(), "a face needs at least three corners");
    parts_.addFace();
    data_.faces.push_back({begin, data_.corners.size(), material_, parts_.mesh()});
    faceLines_.push_back(lines_.position());
  }

  /// Done at the end, because a face may precede its vertices.
  void checkIndices() {
    for (std::size_t face = 0; face < faceLines_.size(); ++face)
      for (std::size_t i = data_.faces[face].begin; i < data_.faces[face].end; ++i)
        checkCorner(data_.corners[i], faceLines_[face]);
  }

  void checkCorner(ObjData::Corner& corner, std::size_t line) const {
    const auto check = [&](int index, std::size_t count, const char* what) {
      if (index == kNone || static_cast<std::size_t>(index) >= count)
        fail(line, fmt::format("a face refers to a {} that does not exist (the file has {})", what, count));
    };
    check(corner.position, data_.positions.size(), "vertex");
    if (corner.uv != kNone) check(corner.uv, data_.uvs.size(), "texture coordinate");
    if (corner.normal != kNone) check(corner.normal, data_.normals.size(), "normal");
    if (anyBadNormal_ && corner.normal != kNone && !data_.normals[corner.normal].allFinite()) corner.normal = kNone;
  }

  [[noreturn]] void fail(std::size_t position, std::string_view message) const {
    throw std::runtime_error(lines_.describe(position, message));
  }

  ObjLines lines_;
  ObjData data_;
  ObjParts parts_;
  std::map<std::string, int> materialIds_{{"", 0}};
  int material_ = 0;                    // of the following faces
  std::vector<std::size_t> faceLines_;  // offsets of the lines of faces
  bool anyBadNormal_ = false;
};

}  // namespace

ObjData parseObj(std::string_view text) {
  return ObjParser(text).parse();
}

ObjMaterials findObjMaterials(std::string_view text, int onlyMesh) {
  ObjMaterials found;
  ObjParts parts;
  ObjLines lines(text);
  std::set<std::string> known;
  while (const std::optional<std::string_view> line = lines.next()) {
    std::string_view rest = *line;
    const std::string_view key = takeWord(rest);
    if (key == "mtllib") found.library = trimmed(rest);
    if (parts.take(key, rest) || key != "f") continue;
    parts.addFace();
    const bool wanted = onlyMesh < 0 || parts.mesh() == onlyMesh;
    if (wanted && known.insert(parts.material()).second) found.names.push_back(parts.material());
  }
  found.last = parts.material();
  return found;
}

}  // namespace lobe
