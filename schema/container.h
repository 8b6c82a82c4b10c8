#pragma once
// The container of all cache files: a 32-byte header that identifies the file type and contains a hash for verifying
// its integrity, followed by the payload (a FlatBuffer). Little-endian.
//
//   offset 0   magic "LOBEBRDF" (the last four letters are the kind)
//          8   format version: major u16, minor u16, then 4 zero bytes
//         16   payload size u64
//         24   XXH3-64 of the payload, seeded with the XXH3-64 of bytes 0 to 23

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace lobe {

/// A file type, and the version of its format that this program writes and reads.
struct FileFormat {
  std::array<char, 4> kind;
  std::uint16_t major, minor;
};

/// The kind as text.
inline std::string_view nameOf(const FileFormat& format) {
  return {format.kind.data(), format.kind.size()};
}

/// The content of a whole file in memory, aligned to 8 bytes if it has a header. It is a copy, so that what has been
/// verified cannot change when another program writes to the file or truncates it. Move-only, because views refer to
/// it; they stay valid when it is moved.
class FileContent {
 public:
  /// Throws std::runtime_error that names the file if it cannot be read or is not a regular file.
  explicit FileContent(const std::filesystem::path& path);
  /// A copy of bytes in memory.
  explicit FileContent(std::span<const std::byte> bytes);
  FileContent(FileContent&&) noexcept = default;
  FileContent& operator=(FileContent&&) noexcept = default;
  std::span<const std::byte> bytes() const { return std::as_bytes(std::span(bytes_)); }

 private:
  std::string bytes_;  // in place only if it is shorter than a header
};

/// The error of a file whose format is newer than this program's: another version of the program can read it.
class NewerFormat : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The bytes of a file: header and payload.
std::vector<std::byte> wrapPayload(const FileFormat& format, std::span<const std::byte> payload);

/// Checks magic, kind, version, size and hash, in this order, and returns the payload, which is 8-byte aligned if
/// `bytes` is. Any minor version is accepted; another major version is refused. Throws std::runtime_error, of which
/// NewerFormat is one, with the message "NAME: what is wrong", and what to do about another version.
std::span<const std::byte> unwrapPayload(const FileFormat& format, std::span<const std::byte> bytes,
                                         const std::string& name);

/// Version and hash from the header.
struct ContainerHeader {
  std::uint16_t major, minor;
  std::uint64_t hash;  ///< hash of the whole content
};

/// The header of bytes that unwrapPayload has accepted.
ContainerHeader containerHeader(std::span<const std::byte> bytes);

/// Whether the bytes begin like a file of this kind. Neither the version nor the remaining content is checked.
bool isOfKind(const FileFormat& format, std::span<const std::byte> bytes);

/// XXH3-64 of text.
std::uint64_t hashText(const std::string& text);

}  // namespace lobe
