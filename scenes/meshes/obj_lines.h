#pragma once
// Internal to scenes/: the lines and words of Wavefront's text files (OBJ and MTL).

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace lobe {

/// Takes one line after the other. Lines may end by LF, CR or both, and go on after a backslash; a byte order mark
/// before them does not matter.
class ObjLines {
 public:
  explicit ObjLines(std::string_view text);

  /// Without its end; nullopt after the last one. Valid until the next call.
  std::optional<std::string_view> next();
  /// Where the line that next() gave last begins.
  std::size_t position() const { return position_; }

  /// "line N: message: "TEXT"", of the line that begins at a position, shortened if it is long.
  std::string describe(std::size_t position, std::string_view message) const;

 private:
  /// One from begin on, which is moved past its end.
  std::string_view takePhysical(std::size_t& begin) const;

  std::string_view text_;
  std::string joined_;
  std::size_t begin_ = 0, position_ = 0;
};

/// Takes the next word off the line; empty at its end.
std::string_view takeWord(std::string_view& line);

}  // namespace lobe
