#include "scenes/mitsuba/file_text.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <memory>
#include <sstream>
#include <string_view>
#include <utility>

#include <iconv.h>

#include <fmt/format.h>

#include "runtime/core/files.h"
#include "scenes/mitsuba/findings.h"

namespace lobe {
namespace {

using namespace std::string_view_literals;

std::string readBytesOf(const std::filesystem::path& path) {
  try {
    return readFile(path);
  } catch (const std::runtime_error& e) {
    throw SceneError(path.string(), e.what());
  }
}

struct Encoding {
  std::string name;
  std::size_t markLength = 0;  // of the byte order mark
};

/// Detects the encoding by the byte order mark or, without one, by the bytes of the first '<'.
Encoding detectedByBytes(std::string_view bytes) {
  static constexpr std::pair<std::string_view, const char*> kMarks[] = {{"\xef\xbb\xbf"sv, "UTF-8"},
                                                                        {"\xff\xfe\0\0"sv, "UTF-32LE"},
                                                                        {"\0\0\xfe\xff"sv, "UTF-32BE"},
                                                                        {"\xff\xfe"sv, "UTF-16LE"},
                                                                        {"\xfe\xff"sv, "UTF-16BE"}};
  for (const auto& [mark, name] : kMarks)
    if (bytes.starts_with(mark)) return {name, mark.size()};
  if (bytes.starts_with("<\0"sv)) return {"UTF-16LE"};
  if (bytes.starts_with("\0<"sv)) return {"UTF-16BE"};
  return {};
}

/// The value of encoding="..." in the XML declaration; empty without one.
std::string declaredEncoding(std::string_view bytes) {
  if (!bytes.starts_with("<?xml")) return {};
  const std::string_view declaration = bytes.substr(0, bytes.find("?>"));
  std::size_t at = declaration.find("encoding");
  if (at == std::string_view::npos) return {};
  at = declaration.find_first_of("\"'", at);
  if (at == std::string_view::npos) return {};
  const std::size_t end = declaration.find(declaration[at], at + 1);
  return end == std::string_view::npos ? "" : std::string(declaration.substr(at + 1, end - at - 1));
}

bool isUtf8(std::string name) {
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::toupper(c); });
  return name.empty() || name == "UTF-8" || name == "UTF8" || name == "ASCII" || name == "US-ASCII";
}

struct CloseConverter {
  void operator()(void* converter) const { iconv_close(converter); }
};

std::string toUtf8(const std::filesystem::path& path, std::string_view bytes, const std::string& encoding) {
  const iconv_t opened = iconv_open("UTF-8", encoding.c_str());
  if (opened == reinterpret_cast<iconv_t>(-1))
    throw SceneError(fmt::format("{}:1:1", path.string()), fmt::format("the encoding \"{}\" is not known", encoding));
  const std::unique_ptr<void, CloseConverter> converter(opened);
  std::string text;
  char block[4096];
  std::string input(bytes);  // iconv takes a pointer to non-const bytes
  char* in = input.data();
  std::size_t left = input.size();
  while (left > 0) {
    char* out = block;
    std::size_t room = sizeof block;
    const std::size_t result = iconv(opened, &in, &left, &out, &room);
    text.append(block, out);
    if (result == static_cast<std::size_t>(-1) && errno != E2BIG)
      throw SceneError(placeIn(path, text, text.size()),
                       fmt::format("invalid bytes for the file's encoding {}", encoding));
  }
  return text;
}

/// Of LineIndex::continuations.
constexpr std::size_t kBlock = 4096;

/// The number of bytes that continue UTF-8 characters.
std::size_t continuationsIn(std::string_view text) {
  return static_cast<std::size_t>(std::ranges::count_if(text, [](char c) { return (c & 0xc0) == 0x80; }));
}

/// The number of characters before the offset.
std::size_t charactersBefore(std::string_view text, const LineIndex& lines, std::size_t offset) {
  const std::size_t block = offset / kBlock;
  return offset - lines.continuations[block] - continuationsIn(text.substr(block * kBlock, offset % kBlock));
}

}  // namespace

std::string readXmlText(const std::filesystem::path& path) {
  std::string bytes = readBytesOf(path);
  const Encoding detected = detectedByBytes(bytes);
  bytes.erase(0, detected.markLength);
  const std::string encoding = detected.name.empty() ? declaredEncoding(bytes) : detected.name;
  return isUtf8(encoding) ? bytes : toUtf8(path, bytes, encoding);
}

LineIndex indexLines(std::string_view text) {
  LineIndex lines{{0}, {0}};
  for (std::size_t i = 0; i < text.size(); ++i)
    if (text[i] == '\n') lines.starts.push_back(i + 1);
  for (std::size_t begin = 0; begin + kBlock <= text.size(); begin += kBlock)
    lines.continuations.push_back(lines.continuations.back() + continuationsIn(text.substr(begin, kBlock)));
  return lines;
}

std::string placeIn(const std::filesystem::path& path, std::string_view text, std::size_t offset) {
  return placeIn(path, text, indexLines(text), offset);
}

std::string placeIn(const std::filesystem::path& path, std::string_view text, const LineIndex& lines,
                    std::size_t offset) {
  offset = std::min(offset, text.size());
  const auto next = std::ranges::upper_bound(lines.starts, offset);
  const std::size_t column = charactersBefore(text, lines, offset) - charactersBefore(text, lines, *(next - 1)) + 1;
  return fmt::format("{}:{}:{}", path.string(), next - lines.starts.begin(), column);
}

}  // namespace lobe
