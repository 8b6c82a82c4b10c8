#pragma once
// The container of every cache file: a 32-byte header that tells what the file is and proves that it is whole, then the
// payload (a FlatBuffer). Little-endian.
//
//   offset 0   magic "LOBEBRDF" (the last four letters are the kind)
//          8   format version: major u16, minor u16, then 4 zero bytes
//         16   payload size u64
//         24   XXH3-64 of the payload, seeded with bytes 0 to 23 hashed the same way

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace lobe {

/// What a file holds, and the version of it that this program writes and reads.
struct FileFormat {
  std::array<char, 4> kind;
  std::uint16_t major, minor;
};

/// Its kind as text.
inline std::string_view nameOf(const FileFormat& format) {
  return {format.kind.data(), format.kind.size()};
}

/// A read-only memory map of a whole file. Move-only.
class MappedFile {
 public:
  /// Throws std::runtime_error that names the file.
  explicit MappedFile(const std::filesystem::path& path);
  MappedFile(MappedFile&& other) noexcept;
  MappedFile& operator=(MappedFile&& other) noexcept;
  ~MappedFile();
  std::span<const std::byte> bytes() const { return {data_, size_}; }

 private:
  const std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

/// Header and payload as the bytes of a file.
std::vector<std::byte> wrapPayload(const FileFormat& format, std::span<const std::byte> payload);

/// Checks magic, kind, version, size and hash, in this order, and returns the payload (8-byte aligned where bytes are).
/// Throws std::runtime_error: "NAME: what is wrong and what to do". A newer minor version is read, a newer major
/// refused.
std::span<const std::byte> unwrapPayload(const FileFormat& format, std::span<const std::byte> bytes,
                                         const std::string& name);

/// What the header says.
struct ContainerHeader {
  std::uint16_t major, minor;
  std::uint64_t hash;  ///< of the whole content
};

/// Of bytes that unwrapPayload has accepted.
ContainerHeader containerHeader(std::span<const std::byte> bytes);

/// Whether bytes begin as a file of this kind does, of whatever version and however damaged further on.
bool isOfKind(const FileFormat& format, std::span<const std::byte> bytes);

/// XXH3-64 of text.
std::uint64_t hashText(const std::string& text);

}  // namespace lobe
