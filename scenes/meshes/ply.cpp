#include "scenes/meshes/ply.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <stdexcept>
#include <string_view>
#include <tuple>

#include <fmt/format.h>

#include "runtime/core/files.h"
#include "runtime/core/numbers.h"
#include "scenes/meshes/polygon.h"
#include "scenes/meshes/world_mesh.h"

namespace lobe {
namespace {

enum class Format { ascii, little, big };
enum class Type { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

struct Property {
  std::string name;
  Type type;
  std::optional<Type> countType;  ///< of lists only
};

struct Element {
  std::string name;
  std::uint64_t count;
  std::vector<Property> properties;

  int find(std::initializer_list<std::string_view> names) const {
    for (std::size_t i = 0; i < properties.size(); ++i)
      if (std::ranges::find(names, properties[i].name) != names.end()) return static_cast<int>(i);
    return -1;
  }
};

struct Header {
  Format format;
  std::vector<Element> elements;
  std::set<std::string> names;  ///< of the elements
  std::size_t size;             ///< in bytes, of the header itself
};

// ---- Header

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> words;
  while (true) {
    line.remove_prefix(std::min(line.find_first_not_of(" \t\r"), line.size()));
    if (line.empty()) return words;
    words.push_back(line.substr(0, line.find_first_of(" \t\r")));
    line.remove_prefix(words.back().size());
  }
}

Type parseType(std::string_view name) {
  static constexpr std::pair<std::string_view, Type> kTypes[] = {
      {"char", Type::int8},   {"uchar", Type::uint8},   {"short", Type::int16},     {"ushort", Type::uint16},
      {"int", Type::int32},   {"uint", Type::uint32},   {"float", Type::float32},   {"double", Type::float64},
      {"int8", Type::int8},   {"uint8", Type::uint8},   {"int16", Type::int16},     {"uint16", Type::uint16},
      {"int32", Type::int32}, {"uint32", Type::uint32}, {"float32", Type::float32}, {"float64", Type::float64}};
  for (const auto& [known, type] : kTypes)
    if (known == name) return type;
  throw std::runtime_error(fmt::format("unknown property type \"{}\"", name));
}

Format parseFormat(std::string_view name) {
  if (name == "ascii") return Format::ascii;
  if (name == "binary_little_endian") return Format::little;
  if (name == "binary_big_endian") return Format::big;
  throw std::runtime_error(fmt::format("unknown format \"{}\"", name));
}

std::uint64_t parseCount(std::string_view text) {
  std::uint64_t count = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), count);
  if (error != std::errc() || end != text.data() + text.size())
    throw std::runtime_error(fmt::format("\"{}\" is not a valid number of elements", text));
  return count;
}

/// Parses one line of the header. Returns false at its end.
bool parseHeaderLine(std::string_view line, Header& header, bool& formatKnown) {
  const std::vector<std::string_view> words = split(line);
  if (words.empty() || words[0] == "comment" || words[0] == "obj_info") return true;
  if (words[0] == "end_header") return false;
  if (words[0] == "format" && words.size() >= 2) {
    header.format = parseFormat(words[1]);
    formatKnown = true;
  } else if (words[0] == "element" && words.size() == 3) {
    // Two lists of vertices could have different properties, so that some vertices would have no normal.
    if (!header.names.emplace(words[1]).second)
      throw std::runtime_error(fmt::format("the header declares the element \"{}\" twice", words[1]));
    header.elements.push_back({std::string(words[1]), parseCount(words[2]), {}});
  } else if (words[0] == "property" && words.size() == 3 && !header.elements.empty()) {
    header.elements.back().properties.push_back({std::string(words[2]), parseType(words[1]), {}});
  } else if (words[0] == "property" && words.size() == 5 && words[1] == "list" && !header.elements.empty()) {
    header.elements.back().properties.push_back({std::string(words[4]), parseType(words[3]), parseType(words[2])});
  } else {
    throw std::runtime_error("the header has an unknown line");
  }
  return true;
}

Header parseHeader(std::string_view file) {
  if (!file.starts_with("ply") || file.size() < 4 || (file[3] != '\n' && file[3] != '\r'))
    throw std::runtime_error("not a PLY file");
  Header header{};
  bool formatKnown = false;
  std::size_t begin = file.find('\n');
  while (begin != std::string_view::npos) {
    const std::size_t end = file.find('\n', ++begin);
    if (end == std::string_view::npos) break;
    if (!parseHeaderLine(file.substr(begin, end - begin), header, formatKnown)) {
      if (!formatKnown) throw std::runtime_error("the header has no format line");
      header.size = end + 1;
      return header;
    }
    begin = end;
  }
  throw std::runtime_error("the header has no end_header line");
}

// ---- Values

/// Reads numbers from the body of the file.
class Values {
 public:
  Values(std::string_view body, Format format) : rest_(body), format_(format) {}

  double next(Type type) {
    if (format_ == Format::ascii) return nextText();
    switch (type) {
      case Type::int8:
        return nextBinary<std::int8_t>();
      case Type::uint8:
        return nextBinary<std::uint8_t>();
      case Type::int16:
        return nextBinary<std::int16_t>();
      case Type::uint16:
        return nextBinary<std::uint16_t>();
      case Type::int32:
        return nextBinary<std::int32_t>();
      case Type::uint32:
        return nextBinary<std::uint32_t>();
      case Type::float32:
        return nextBinary<float>();
      case Type::float64:
        break;
    }
    return nextBinary<double>();
  }

  /// The length of a list, which cannot exceed the number of bytes left.
  std::size_t nextCount(Type type) {
    const double count = next(type);
    if (!(count >= 0 && count == std::floor(count))) throw std::runtime_error("a list has an invalid length");
    if (count > static_cast<double>(rest_.size())) truncated();
    return static_cast<std::size_t>(count);
  }

  std::size_t bytesLeft() const { return rest_.size(); }
  [[noreturn]] static void truncated() { throw std::runtime_error("the file is truncated"); }

 private:
  double nextText() {
    rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t\r\n"), rest_.size()));
    if (rest_.empty()) truncated();
    const std::string_view word = rest_.substr(0, rest_.find_first_of(" \t\r\n"));
    const std::optional<double> value = parseReal(word);
    if (!value) throw std::runtime_error(fmt::format("\"{}\" is not a number", word.substr(0, 40)));
    rest_.remove_prefix(word.size());
    return *value;
  }

  template <class T>
  double nextBinary() {
    if (rest_.size() < sizeof(T)) truncated();
    std::array<char, sizeof(T)> bytes;
    std::memcpy(bytes.data(), rest_.data(), sizeof(T));
    if ((format_ == Format::big) != (std::endian::native == std::endian::big)) std::ranges::reverse(bytes);
    rest_.remove_prefix(sizeof(T));
    return static_cast<double>(std::bit_cast<T>(bytes));
  }

  std::string_view rest_;
  Format format_;
};

/// Property indices of the lists that are read from an element; −1 for a list that the element does not have.
constexpr std::size_t kWantedLists = 2;
using WantedLists = std::array<int, kWantedLists>;
constexpr WantedLists kNoLists = {-1, -1};

/// The values of one item of an element: one number per property (unused for lists), and the wanted lists.
struct Item {
  std::vector<double> scalars;
  std::array<std::vector<double>, kWantedLists> lists;
};

void readList(const Property& property, Values& values, std::vector<double>* list) {
  const std::size_t count = values.nextCount(*property.countType);
  for (std::size_t k = 0; k < count; ++k) {
    const double value = values.next(property.type);
    if (list) list->push_back(value);
  }
}

void readItem(const Element& element, const WantedLists& wanted, Values& values, Item& item) {
  for (std::vector<double>& list : item.lists) list.clear();
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const Property& property = element.properties[i];
    if (!property.countType) {
      item.scalars[i] = values.next(property.type);
      continue;
    }
    const auto which = static_cast<std::size_t>(std::ranges::find(wanted, static_cast<int>(i)) - wanted.begin());
    readList(property, values, which < kWantedLists ? &item.lists[which] : nullptr);
  }
}

/// Calls take(item) for each item of the element.
template <class Take>
void readElement(const Element& element, const WantedLists& wanted, Values& values, const Take& take) {
  // Every property takes at least one byte, so a wrong count soon runs into the end of the file; without properties it
  // would not.
  if (element.properties.empty()) return;
  Item item{std::vector<double>(element.properties.size()), {}};
  for (std::uint64_t i = 0; i < element.count; ++i) {
    readItem(element, wanted, values, item);
    take(item);
  }
}

// ---- Mesh

/// Property indices of a vector's components; negative for a missing component.
template <std::size_t N>
struct Places {
  std::array<int, N> place;

  bool complete() const {
    return std::ranges::none_of(place, [](int p) { return p < 0; });
  }
  Eigen::Matrix<float, N, 1> from(const std::vector<double>& scalars) const {
    Eigen::Matrix<float, N, 1> v;
    for (std::size_t i = 0; i < N; ++i) v[static_cast<Eigen::Index>(i)] = static_cast<float>(scalars[place[i]]);
    return v;
  }
};

/// The polygons as read. They are assembled later, because a file may have faces before vertices.
struct PlyData {
  TriangleMesh vertices;  ///< without triangles
  std::vector<std::uint32_t> corners;
  std::vector<std::size_t> faceEnds{0};  ///< face i has the corners [faceEnds[i], faceEnds[i + 1])
  std::vector<Vec2> cornerUvs;           ///< one per corner, or empty
};

void readVertices(const Element& element, Values& values, TriangleMesh& mesh) {
  const auto place = [&element](std::initializer_list<std::string_view> names) {
    const int i = element.find(names);
    return i >= 0 && !element.properties[i].countType ? i : -1;
  };
  const Places<3> position{place({"x"}), place({"y"}), place({"z"})};
  const Places<3> normal{place({"nx"}), place({"ny"}), place({"nz"})};
  const Places<2> uv{place({"u", "s", "texture_u", "texture_s"}), place({"v", "t", "texture_v", "texture_t"})};
  if (!position.complete()) throw std::runtime_error("the vertices have no x, y and z");
  const bool hasNormals = normal.complete(), hasUvs = uv.complete();
  mesh.positions.reserve(std::min<std::uint64_t>(element.count, values.bytesLeft() / 3));
  readElement(element, kNoLists, values, [&](const Item& item) {
    mesh.positions.push_back(position.from(item.scalars));
    if (hasNormals) mesh.normals.push_back(normal.from(item.scalars));
    if (hasUvs) mesh.uvs.push_back(uv.from(item.scalars));
  });
}

std::uint32_t vertexIndex(double value) {
  if (!(value >= 0 && value == std::floor(value) && value < 4294967296.0))
    throw std::runtime_error(fmt::format("a face refers to vertex {}, which is not a valid index", value));
  return static_cast<std::uint32_t>(value);
}

/// A face without texture coordinates gets (0, 0) for all of its corners.
void addCornerUvs(const std::vector<double>& numbers, std::size_t corners, std::vector<Vec2>& uvs) {
  if (!numbers.empty() && numbers.size() != 2 * corners)
    throw std::runtime_error(fmt::format(
        "a face with {} corners has {} texture coordinate values instead of two per corner", corners, numbers.size()));
  for (const double number : numbers)
    if (!std::isfinite(static_cast<float>(number)))
      throw std::runtime_error("a texture coordinate is not a finite number");
  for (std::size_t i = 0; i < corners; ++i)
    uvs.push_back(numbers.empty() ? Vec2(0, 0) : Vec2(Eigen::Vector2d(&numbers[2 * i]).cast<float>()));
}

void readFaces(const Element& element, Values& values, PlyData& data) {
  const auto place = [&element](std::initializer_list<std::string_view> names) {
    const int i = element.find(names);
    return i >= 0 && element.properties[i].countType ? i : -1;
  };
  const int list = place({"vertex_indices", "vertex_index"}), uvs = place({"texcoord", "texture_uv"});
  if (list < 0) throw std::runtime_error("the faces have no vertex_indices");
  readElement(element, {list, uvs}, values, [&](const Item& item) {
    const std::vector<double>& indices = item.lists[0];
    std::ranges::transform(indices, std::back_inserter(data.corners), vertexIndex);
    data.faceEnds.push_back(data.corners.size());
    if (uvs >= 0) addCornerUvs(item.lists[1], indices.size(), data.cornerUvs);
  });
}

PlyData parsePly(std::string_view file) {
  const Header header = parseHeader(file);
  Values values(file.substr(header.size), header.format);
  PlyData data;
  for (const Element& element : header.elements) {
    if (element.name == "vertex")
      readVertices(element, values, data.vertices);
    else if (element.name == "face")
      readFaces(element, values, data);
    else
      readElement(element, kNoLists, values, [](const Item&) {});
  }
  const std::size_t count = data.vertices.positions.size();
  for (const std::uint32_t i : data.corners)
    if (i >= count) throw std::runtime_error(fmt::format("a face refers to vertex {}, but there are {}", i, count));
  return data;
}

/// Converts texture coordinates of corners to those of vertices: creates one vertex for each distinct pair of vertex
/// and texture coordinates.
void splitByUv(PlyData& data) {
  TriangleMesh split;
  std::map<std::tuple<std::uint32_t, float, float>, std::uint32_t> known;
  for (std::size_t i = 0; i < data.corners.size(); ++i) {
    const std::uint32_t from = data.corners[i];
    const Vec2& uv = data.cornerUvs[i];
    const auto [entry, isNew] =
        known.try_emplace({from, uv.x(), uv.y()}, static_cast<std::uint32_t>(split.positions.size()));
    data.corners[i] = entry->second;
    if (!isNew) continue;
    split.positions.push_back(data.vertices.positions[from]);
    if (!data.vertices.normals.empty()) split.normals.push_back(data.vertices.normals[from]);
    split.uvs.push_back(uv);
  }
  data.vertices = std::move(split);
}

TriangleMesh buildMesh(PlyData data) {
  if (!data.cornerUvs.empty()) splitByUv(data);
  TriangleMesh mesh = std::move(data.vertices);
  for (std::size_t face = 0; face + 1 < data.faceEnds.size(); ++face) {
    const std::span<const std::uint32_t> corners(data.corners.data() + data.faceEnds[face],
                                                 data.faceEnds[face + 1] - data.faceEnds[face]);
    if (corners.size() >= 3) appendPolygon(mesh, corners);
  }
  return mesh;
}

}  // namespace

TriangleMesh readPly(const std::filesystem::path& path, const MeshOptions& options) {
  return nameErrors(path, [&] { return toWorldMesh(buildMesh(parsePly(readFile(path))), options); });
}

}  // namespace lobe
