#include "schema/container.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstring>
#include <stdexcept>

#include <fmt/format.h>
#include <xxhash.h>

#include "runtime/core/files.h"
#include "runtime/core/printable.h"

namespace lobe {
namespace {

static_assert(std::endian::native == std::endian::little, "cache files are read in place and are little-endian");

struct Header {
  char magic[4];
  char kind[4];
  std::uint16_t major, minor;
  std::uint32_t reserved;
  std::uint64_t payloadSize;
  std::uint64_t hash;
};
static_assert(sizeof(Header) == 32);
constexpr std::size_t kHashedHeaderBytes = offsetof(Header, hash);
constexpr char kMagic[] = {'L', 'O', 'B', 'E'};

std::uint64_t contentHash(const Header& header, std::span<const std::byte> payload) {
  const std::uint64_t seed = XXH3_64bits(&header, kHashedHeaderBytes);
  return XXH3_64bits_withSeed(payload.data(), payload.size(), seed);
}

[[noreturn]] void refuse(const std::string& name, const std::string& fault) {
  throw std::runtime_error(name + ": " + fault);
}

void checkVersion(const FileFormat& format, const Header& header, const std::string& name) {
  if (header.major == format.major) return;
  const bool newer = header.major > format.major;
  const std::string fault = fmt::format("{}: format version {}.{} is {} than this program's {}.{}: {}", name,
                                        header.major, header.minor, newer ? "newer" : "older", format.major,
                                        format.minor, newer ? "use a newer Lobe" : "make the file again");
  if (newer) throw NewerFormat(fault);
  throw std::runtime_error(fault);
}

}  // namespace

FileContent::FileContent(const std::filesystem::path& path)
    : bytes_(nameErrors(path, [&] { return readFile(path); })) {}

FileContent::FileContent(std::span<const std::byte> bytes)
    : bytes_(reinterpret_cast<const char*>(bytes.data()), bytes.size()) {}

std::vector<std::byte> wrapPayload(const FileFormat& format, std::span<const std::byte> payload) {
  Header header{};
  std::memcpy(header.magic, kMagic, sizeof(kMagic));
  std::memcpy(header.kind, format.kind.data(), sizeof(header.kind));
  header.major = format.major;
  header.minor = format.minor;
  header.payloadSize = payload.size();
  header.hash = contentHash(header, payload);
  std::vector<std::byte> bytes(sizeof(header) + payload.size());
  std::memcpy(bytes.data(), &header, sizeof(header));
  std::ranges::copy(payload, bytes.begin() + sizeof(header));
  return bytes;
}

std::span<const std::byte> unwrapPayload(const FileFormat& format, std::span<const std::byte> bytes,
                                         const std::string& name) {
  if (bytes.empty()) refuse(name, "the file is empty");
  const std::size_t magicBytes = std::min(bytes.size(), sizeof(kMagic));
  if (std::memcmp(bytes.data(), kMagic, magicBytes) != 0) refuse(name, "not a Lobe file");
  Header header;
  if (bytes.size() < sizeof(header))
    refuse(name, fmt::format("truncated: {} bytes, the header alone has {}", bytes.size(), sizeof(header)));
  std::memcpy(&header, bytes.data(), sizeof(header));
  if (std::memcmp(header.kind, format.kind.data(), sizeof(header.kind)) != 0)
    refuse(name, fmt::format("a Lobe file of kind '{}', expected '{}'", printable({header.kind, sizeof(header.kind)}),
                             nameOf(format)));
  checkVersion(format, header, name);
  const std::span<const std::byte> payload = bytes.subspan(sizeof(header));
  if (header.payloadSize != payload.size())
    refuse(name, fmt::format("{}: {} bytes, expected {}", payload.size() < header.payloadSize ? "truncated" : "damaged",
                             bytes.size(), header.payloadSize + sizeof(header)));
  if (header.hash != contentHash(header, payload)) refuse(name, "damaged: the content does not match its hash");
  return payload;
}

ContainerHeader containerHeader(std::span<const std::byte> bytes) {
  Header header;
  std::memcpy(&header, bytes.data(), sizeof(header));
  return {header.major, header.minor, header.hash};
}

bool isOfKind(const FileFormat& format, std::span<const std::byte> bytes) {
  constexpr std::size_t kindAt = offsetof(Header, kind);
  return bytes.size() >= kindAt + format.kind.size() && std::memcmp(bytes.data(), kMagic, sizeof(kMagic)) == 0 &&
         std::memcmp(bytes.data() + kindAt, format.kind.data(), format.kind.size()) == 0;
}

std::uint64_t hashText(const std::string& text) {
  return XXH3_64bits(text.data(), text.size());
}

}  // namespace lobe
