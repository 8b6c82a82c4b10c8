#pragma once
// The tensor files of the RGL material database: named arrays of any dimension. Little endian:
//
//   12 bytes   "tensor_file" and a zero byte
//    2 bytes   version, 1 and 0
//    uint32    number of fields, then for each of them
//      uint16    length of the name, and the name
//      uint16    number of dimensions
//      uint8     type of the elements
//      uint64    offset of the elements from the beginning of the file
//      uint64    extent in each dimension, the slowest first

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace lobe {

/// Elements in the file's order, the last dimension fastest.
template <typename T>
struct Tensor {
  std::vector<std::size_t> shape;
  std::vector<T> values;
};

/// All errors are std::runtime_error, and name the file and the field.
class TensorFile {
 public:
  /// Reads the file and checks that every field lies within it.
  explicit TensorFile(const std::filesystem::path& path);

  bool has(const std::string& name) const { return fields_.contains(name); }
  /// The field, which must have elements of this type and the given number of dimensions, must not be empty and must
  /// contain only finite numbers of up to 1e9.
  Tensor<float> floats(const std::string& name, std::size_t dimensions) const;
  Tensor<std::uint8_t> bytes(const std::string& name, std::size_t dimensions) const;

  /// Hash of the whole file.
  std::uint64_t hash() const { return hash_; }

  [[noreturn]] void fail(const std::string& message) const;
  [[noreturn]] void fail(const std::string& field, const std::string& message) const;

 private:
  enum class Type : std::uint8_t { uint8 = 1, float32 = 10 };
  struct Field {
    Type type;
    std::vector<std::size_t> shape;
    std::size_t offset;
    std::size_t count;  ///< number of elements
  };
  class Cursor;

  void readField(Cursor& cursor);
  const Field& field(const std::string& name, Type type, std::size_t dimensions) const;
  template <typename T>
  Tensor<T> tensor(const Field& field) const;

  std::string path_;
  std::string bytes_;
  std::uint64_t hash_;
  std::map<std::string, Field> fields_;
};

}  // namespace lobe
