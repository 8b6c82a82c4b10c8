#pragma once
// Reads scene files in any encoding as UTF-8.

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace lobe {

/// The file's content in UTF-8, without a byte order mark. Its encoding is given by its byte order mark (UTF-8, UTF-16,
/// UTF-32), else by its XML declaration, else it is UTF-8; UTF-8 text is returned unchanged. Throws SceneError at the
/// file (or at the offending byte) when it cannot be read, is empty, names an unknown encoding, or is not valid in its
/// encoding.
std::string readXmlText(const std::filesystem::path& path);

/// Where the lines of a UTF-8 text begin, and where its characters have several bytes.
struct LineIndex {
  std::vector<std::size_t> starts;         ///< offsets of the lines
  std::vector<std::size_t> continuations;  ///< for each block of the text, how many bytes before it continue characters
};
LineIndex indexLines(std::string_view text);

/// "FILE:LINE:COLUMN" of an offset in a file's text; columns count characters from one.
std::string placeIn(const std::filesystem::path& path, std::string_view text, std::size_t offset);
/// The same for a text that has been indexed, in a time that does not depend on its length.
std::string placeIn(const std::filesystem::path& path, std::string_view text, const LineIndex& lines,
                    std::size_t offset);

}  // namespace lobe
