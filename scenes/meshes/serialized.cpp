#include "scenes/meshes/serialized.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>
#include <zlib.h>

#include "runtime/core/files.h"
#include "scenes/meshes/world_mesh.h"

namespace lobe {
namespace {

static_assert(std::endian::native == std::endian::little, "the files are little-endian");

constexpr std::uint16_t kMagic = 0x041c;
// Upper bound of zlib's compression ratio.
constexpr std::uint64_t kMaxExpansion = 1032;

enum Flags : std::uint32_t {
  kHasNormals = 0x0001,
  kHasTexcoords = 0x0002,
  kHasColours = 0x0008,
  kFaceNormals = 0x0010,
  kSinglePrecision = 0x1000,
  kDoublePrecision = 0x2000,
};

template <class T>
T readValue(std::istream& file) {
  T value{};
  if (!file.read(reinterpret_cast<char*>(&value), sizeof(T))) throw std::runtime_error("the file is truncated");
  return value;
}

/// Reads the file format's magic number and version at `begin`; the version determines the width of offsets.
std::uint16_t readVersion(std::istream& file, std::uint64_t begin) {
  file.seekg(static_cast<std::streamoff>(begin));
  if (readValue<std::uint16_t>(file) != kMagic) throw std::runtime_error("not a serialized mesh");
  const auto version = readValue<std::uint16_t>(file);
  if (version != 3 && version != 4)
    throw std::runtime_error(fmt::format("version {} is not supported, only 3 and 4", version));
  return version;
}

struct Extent {
  std::uint64_t begin, end;
};

/// Looks up a mesh in the table at the end of the file: offsets of 8 bytes (4 in version 3), then their number.
Extent findMesh(std::istream& file, std::uint64_t size, int index) {
  const std::uint64_t width = readVersion(file, 0) == 4 ? 8 : 4;
  file.seekg(static_cast<std::streamoff>(size - 4));
  const auto count = readValue<std::uint32_t>(file);
  if (index < 0 || static_cast<std::uint32_t>(index) >= count)
    throw std::runtime_error(fmt::format("there is no mesh {}: the file has {}, counted from 0", index, count));
  const std::uint64_t tableSize = 4 + width * count;
  if (tableSize > size) throw std::runtime_error("the table of meshes is damaged");
  const auto entry = [&](std::uint32_t i) -> std::uint64_t {
    if (i == count) return size - tableSize;
    file.seekg(static_cast<std::streamoff>(size - tableSize + width * i));
    return width == 8 ? readValue<std::uint64_t>(file) : readValue<std::uint32_t>(file);
  };
  const Extent extent{entry(static_cast<std::uint32_t>(index)), entry(static_cast<std::uint32_t>(index) + 1)};
  if (extent.begin + 4 > extent.end || extent.end > size - tableSize)
    throw std::runtime_error("the table of meshes is damaged");
  return extent;
}

/// Decompresses a stream in memory incrementally.
class Inflater {
 public:
  explicit Inflater(std::string packed) : packed_(std::move(packed)) {
    if (packed_.size() > std::numeric_limits<uInt>::max())
      throw std::runtime_error("compressed meshes over 4 GB are not supported");
    stream_.next_in = reinterpret_cast<Bytef*>(packed_.data());
    stream_.avail_in = static_cast<uInt>(packed_.size());
    if (inflateInit(&stream_) != Z_OK) throw std::runtime_error("cannot initialise zlib");
  }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
  ~Inflater() { inflateEnd(&stream_); }

  template <class T>
  T value() {
    T result{};
    fill(&result, sizeof(T));
    return result;
  }

  /// The count comes from the file, so it is checked, and memory is allocated in blocks as the data is found.
  template <class T>
  std::vector<T> values(std::uint64_t count) {
    constexpr std::uint64_t kBlock = 1 << 20;
    if (count > kMaxExpansion * packed_.size() / sizeof(T)) throw std::runtime_error("an element count is damaged");
    std::vector<T> result;
    while (result.size() < count) {
      const std::uint64_t begin = result.size(), size = std::min(kBlock, count - begin);
      if (begin + size > result.capacity()) result.reserve(std::min(count, 2 * begin + kBlock));
      result.resize(begin + size);
      fill(&result[begin], size * sizeof(T));
    }
    return result;
  }

 private:
  void fill(void* data, std::uint64_t bytes) {
    auto* out = static_cast<Bytef*>(data);
    while (bytes > 0) {
      const auto piece = static_cast<uInt>(std::min<std::uint64_t>(bytes, 1u << 30));
      stream_.next_out = out;
      stream_.avail_out = piece;
      const int status = inflate(&stream_, Z_NO_FLUSH);
      const uInt done = piece - stream_.avail_out;
      if (done == 0 || (status != Z_OK && status != Z_STREAM_END))
        throw std::runtime_error("the mesh is damaged or truncated");
      out += done;
      bytes -= done;
    }
  }

  std::string packed_;
  z_stream stream_{};
};

template <class Real, int size>
std::vector<Eigen::Vector<float, size>> readVectors(Inflater& in, std::uint64_t count) {
  const std::vector<Real> numbers = in.values<Real>(size * count);
  std::vector<Eigen::Vector<float, size>> result;
  result.reserve(count);
  for (std::size_t i = 0; i < numbers.size(); i += size)
    result.push_back(Eigen::Map<const Eigen::Vector<Real, size>>(&numbers[i]).template cast<float>());
  return result;
}

template <class Real>
void readVertices(Inflater& in, std::uint32_t flags, std::uint64_t count, TriangleMesh& mesh) {
  mesh.positions = readVectors<Real, 3>(in, count);
  if (flags & kHasNormals) mesh.normals = readVectors<Real, 3>(in, count);
  if (flags & kHasTexcoords) mesh.uvs = readVectors<Real, 2>(in, count);
  if (flags & kHasColours) in.values<Real>(3 * count);
  if (flags & kFaceNormals) mesh.normals.clear();
}

void readTriangles(Inflater& in, std::uint64_t count, TriangleMesh& mesh) {
  const std::vector<std::uint32_t> indices = in.values<std::uint32_t>(3 * count);
  mesh.triangles.reserve(count);
  for (std::size_t i = 0; i < indices.size(); i += 3)
    mesh.triangles.push_back({indices[i], indices[i + 1], indices[i + 2]});
  for (const std::uint32_t index : indices)
    if (index >= mesh.positions.size())
      throw std::runtime_error(fmt::format("a triangle refers to vertex {} of {}", index, mesh.positions.size()));
}

void skipName(Inflater& in) {
  constexpr int kLongest = 1 << 16;
  for (int length = 0; in.value<char>() != '\0'; ++length)
    if (length == kLongest) throw std::runtime_error(fmt::format("the mesh's name is longer than {} bytes", kLongest));
}

/// What may follow the header of a mesh.
struct Limits {
  std::uintmax_t fileBytes, harmless;

  /// Throws if a mesh of these numbers is refused. Its data can be a thousand times as large as the file.
  void check(std::uint64_t vertices, std::uint64_t triangles) const {
    if (vertices > std::numeric_limits<std::uint32_t>::max()) throw std::runtime_error("more than 2^32 vertices");
    if (triangles > std::numeric_limits<std::uint32_t>::max()) throw std::runtime_error("more than 2^32 triangles");
    const std::uintmax_t limit = MeshBudget::limitFor(fileBytes, harmless);
    if (vertices + triangles > limit)
      throw std::runtime_error(
          fmt::format("the mesh has more than {} triangles and vertices together, the limit for a file of {} bytes",
                      limit, fileBytes));
  }
};

TriangleMesh unpack(Inflater& in, int version, const Limits& limits, bool& faceNormals) {
  const auto flags = in.value<std::uint32_t>();
  if (version == 4) skipName(in);
  const auto vertices = in.value<std::uint64_t>();
  const auto triangles = in.value<std::uint64_t>();
  limits.check(vertices, triangles);
  faceNormals = faceNormals || (flags & kFaceNormals);
  TriangleMesh mesh;
  if (flags & kDoublePrecision)
    readVertices<double>(in, flags, vertices, mesh);
  else
    readVertices<float>(in, flags, vertices, mesh);
  readTriangles(in, triangles, mesh);
  return mesh;
}

TriangleMesh readFrom(const std::filesystem::path& path, int index, MeshOptions options, std::uintmax_t harmless) {
  std::ifstream file = openFile(path);
  const std::uint64_t size = std::filesystem::file_size(path);
  if (size < 8) throw std::runtime_error("not a serialized mesh");
  const Extent extent = findMesh(file, size, index);
  const int version = readVersion(file, extent.begin);
  std::string packed(extent.end - extent.begin - 4, '\0');
  if (!file.read(packed.data(), static_cast<std::streamsize>(packed.size())))
    throw std::runtime_error("the file is truncated");
  Inflater in(std::move(packed));
  TriangleMesh mesh = unpack(in, version, {size, harmless}, options.faceNormals);
  return toWorldMesh(std::move(mesh), options);
}

}  // namespace

TriangleMesh readSerialized(const std::filesystem::path& path, int index, const MeshOptions& options,
                            std::uintmax_t harmless) {
  return nameErrors(path, [&] { return readFrom(path, index, options, harmless); });
}

}  // namespace lobe
