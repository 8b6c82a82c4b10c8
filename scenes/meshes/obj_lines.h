#pragma once
// Internal to scenes/: splits Wavefront text files (OBJ and MTL) into lines and words.

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace lobe {

/// Iterates over the lines of a text. Lines end with LF, CR or CR LF, and a backslash at the end of a line continues
/// it. A leading byte order mark is skipped.
class ObjLines {
 public:
  explicit ObjLines(std::string_view text);

  /// The next line without its line ending; nullopt after the last one. Valid until the next call.
  std::optional<std::string_view> next();
  /// Offset of the line that next() returned last.
  std::size_t position() const { return position_; }

  /// "line N: message: "TEXT"" for the line that next() returned last; a long line is shortened.
  std::string describe(std::string_view message) const { return describe(number_, position_, message); }
  /// The same for the line that begins at a position. Counts the lines before it.
  std::string describe(std::size_t position, std::string_view message) const;

 private:
  std::string describe(std::size_t number, std::size_t position, std::string_view message) const;
  /// The physical line at begin, which is moved to the next line.
  std::string_view takePhysical(std::size_t& begin) const;

  std::string_view text_;
  std::string joined_;
  std::size_t begin_ = 0, position_ = 0;
  std::size_t number_ = 0, nextNumber_ = 1;  // of the lines at position_ and at begin_
};

/// Removes the next word from the line and returns it; empty at the end of the line.
std::string_view takeWord(std::string_view& line);

}  // namespace lobe
