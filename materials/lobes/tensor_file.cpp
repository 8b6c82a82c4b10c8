#include "materials/lobes/tensor_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string_view>

#include <fmt/format.h>

#include "runtime/core/files.h"

namespace lobe {
namespace {

static_assert(std::endian::native == std::endian::little, "elements are copied without conversion of their byte order");

constexpr std::string_view kMagic("tensor_file\0", 12);
constexpr std::size_t kMaxDimensions = 16;

// Indexed by the number of the type: integers of 8 to 64 bits, each unsigned and signed, then floats of 16 to 64 bits.
constexpr std::array<std::size_t, 12> kElementBytes = {0, 1, 1, 2, 2, 4, 4, 8, 8, 2, 4, 8};

}  // namespace

/// Reads the bytes in order; fails at the end of the file.
class TensorFile::Cursor {
 public:
  explicit Cursor(const TensorFile& file) : file_(file) {}

  template <typename T>
  T number(const std::string& what) {
    T value;
    std::memcpy(&value, take(sizeof(T), what), sizeof(T));
    return value;
  }
  std::string text(std::size_t length, const std::string& what) { return {take(length, what), length}; }

 private:
  const char* take(std::size_t count, const std::string& what) {
    if (count > file_.bytes_.size() - position_) file_.fail(fmt::format("the file ends within {}", what));
    position_ += count;
    return file_.bytes_.data() + (position_ - count);
  }

  const TensorFile& file_;
  std::size_t position_ = 0;
};

TensorFile::TensorFile(const std::filesystem::path& path)
    : path_(path.string()), bytes_(nameErrors(path, [&] { return readFile(path); })), hash_(contentHash(bytes_)) {
  Cursor cursor(*this);
  if (bytes_.size() < kMagic.size() || cursor.text(kMagic.size(), "") != kMagic) fail("not a tensor file");
  const int major = cursor.number<std::uint8_t>("its version");
  const int minor = cursor.number<std::uint8_t>("its version");
  if (major != 1 || minor != 0) fail(fmt::format("version {}.{} is not supported, only 1.0", major, minor));
  const auto count = cursor.number<std::uint32_t>("its number of fields");
  for (std::uint32_t i = 0; i < count; ++i) readField(cursor);
}

void TensorFile::readField(Cursor& cursor) {
  const auto length = cursor.number<std::uint16_t>("the list of fields");
  const std::string name = cursor.text(length, "the list of fields");
  const std::string what = fmt::format("the description of field \"{}\"", name);
  const std::size_t dimensions = cursor.number<std::uint16_t>(what);
  if (dimensions > kMaxDimensions) fail(name, fmt::format("has {} dimensions", dimensions));
  const auto type = cursor.number<std::uint8_t>(what);
  if (type == 0 || type >= kElementBytes.size()) fail(name, fmt::format("has elements of the unknown type {}", type));
  const auto offset = cursor.number<std::uint64_t>(what);
  if (offset > bytes_.size())
    fail(name, fmt::format("starts at byte {}, but the file has only {} bytes", offset, bytes_.size()));
  // Checked against the number of elements that the file can hold, so that the product of extents cannot overflow.
  const std::size_t most = (bytes_.size() - offset) / kElementBytes[type];
  Field field{static_cast<Type>(type), {}, offset, 1};
  for (std::size_t i = 0; i < dimensions; ++i) {
    const auto extent = cursor.number<std::uint64_t>(what);
    if (extent > 0 && field.count > most / extent) fail(name, "is larger than the rest of the file");
    field.count *= extent;
    field.shape.push_back(extent);
  }
  if (field.count > most) fail(name, "is larger than the rest of the file");
  if (!fields_.emplace(name, std::move(field)).second) fail(name, "occurs twice");
}

const TensorFile::Field& TensorFile::field(const std::string& name, Type type, std::size_t dimensions) const {
  const auto it = fields_.find(name);
  if (it == fields_.end()) fail(name, "is missing");
  const Field& field = it->second;
  if (field.type != type)
    fail(name, fmt::format("has elements of type {}, but {} are needed", static_cast<int>(field.type),
                           type == Type::uint8 ? "8-bit integers (1)" : "32-bit floats (10)"));
  if (field.shape.size() != dimensions)
    fail(name, fmt::format("has {} dimensions, but {} are needed", field.shape.size(), dimensions));
  if (field.count == 0) fail(name, "is empty");
  return field;
}

template <typename T>
Tensor<T> TensorFile::tensor(const Field& field) const {
  Tensor<T> result{field.shape, std::vector<T>(field.count)};
  std::memcpy(result.values.data(), bytes_.data() + field.offset, field.count * sizeof(T));
  return result;
}

Tensor<float> TensorFile::floats(const std::string& name, std::size_t dimensions) const {
  Tensor<float> result = tensor<float>(field(name, Type::float32, dimensions));
  // Products of some values must be finite. The negation also finds NaN.
  constexpr float kLargest = 1e9f;
  if (!std::ranges::all_of(result.values, [](float x) { return std::abs(x) <= kLargest; }))
    fail(name, fmt::format("contains numbers that are not finite or over {:g}", kLargest));
  return result;
}

Tensor<std::uint8_t> TensorFile::bytes(const std::string& name, std::size_t dimensions) const {
  return tensor<std::uint8_t>(field(name, Type::uint8, dimensions));
}

void TensorFile::fail(const std::string& message) const {
  throw std::runtime_error(fmt::format("{}: {}", path_, message));
}

void TensorFile::fail(const std::string& field, const std::string& message) const {
  fail(fmt::format("field \"{}\" {}", field, message));
}

}  // namespace lobe
