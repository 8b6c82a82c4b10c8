#pragma once
// The container of every cache file: a 32-byte header that tells what the file is and proves that it is whole, then the
// payload (a FlatBuffer). Little-endian.
//
//   offset 0   magic "LOBEBRDF" (the last four letters are the kind)
//          8   format version: major u16, minor u16, then 4 zero bytes
//         16   payload size u64
//         24   XXH3-64 of the payload, seeded with bytes 0 to 23 hashed the same way

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace lobe {

inline constexpr std::uint16_t kFormatMajor = 3;
inline constexpr std::uint16_t kFormatMinor = 0;

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

/// Header and payload as the bytes of a file. kind: four letters.
std::vector<std::byte> wrapPayload(const std::string& kind, std::span<const std::byte> payload);

/// Checks magic, kind, version, size and hash, in this order, and returns the payload (8-byte aligned where bytes are).
/// Throws std::runtime_error: "NAME: what is wrong and what to do". A newer minor version is read, a newer major
/// refused.
std::span<const std::byte> unwrapPayload(const std::string& kind, std::span<const std::byte> bytes,
                                         const std::string& name);

/// What the header says.
struct ContainerHeader {
  std::uint16_t major, minor;
  std::uint64_t hash;  ///< of the whole content
};

/// Of bytes that unwrapPayload has accepted.
ContainerHeader containerHeader(std::span<const std::byte> bytes);

/// XXH3-64 of text.
std::uint64_t hashText(const std::string& text);

}  // namespace lobe
