#pragma once
// Text of unknown origin for the terminal.

#include <string>
#include <string_view>

namespace lobe {

/// The text, in UTF-8, with control characters (also line ends, and U+0080 to U+009F) and bytes that are not UTF-8
/// replaced by '?'. For texts from files: a terminal would obey their escape sequences.
std::string printable(std::string_view text);

}  // namespace lobe
