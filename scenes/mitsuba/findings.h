#pragma once
// Faults, warnings and notes that are found while reading a scene file, each with its location.

#include <cstddef>
#include <filesystem>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace lobe {

/// The text or, if it has more than that many bytes, its beginning and "...". Names and values in a file may be of any
/// length, and one of them may be part of many messages.
std::string shortened(std::string_view text, std::size_t most = 100);

/// Something in a scene file that is wrong or unknown.
struct Fault {
  std::string where;        ///< "FILE:LINE:COLUMN"; for a file that cannot be opened, its path
  std::string message;      ///< what was found, and what is known or expected
  std::string consequence;  ///< what lenient reading does instead; empty if it cannot continue
  std::size_t count = 1;    ///< number of faults of this kind; `where` is that of the first

  /// One line: location, message, and what --lenient would do.
  std::string text() const;
};

/// One or more faults of a scene file. what() has one line for each of up to ten faults and, if there are several, a
/// last line with their number, which refers to --lenient and --check.
class SceneError : public std::runtime_error {
 public:
  SceneError(std::string where, std::string message);
  /// An empty list means that reading failed because of a fault that has been reported already.
  explicit SceneError(std::vector<Fault> all);

  const std::vector<Fault>& faults() const { return faults_; }

 private:
  std::vector<Fault> faults_;
};

/// Collects findings in the order of the file. Findings of the same kind are counted, and only the first of them is
/// kept. Extremely long messages are shortened.
class Findings {
 public:
  /// Beyond a limit on the number of kinds, faults are only counted, as one last fault that names the limit.
  void fault(std::string where, const std::string& kind, const std::string& message, const std::string& consequence);
  /// Adds a warning about something that is not read as written. The message says what was found and what is done
  /// instead.
  void warn(const std::string& where, const std::string& kind, const std::string& message);
  /// Adds a note about something that is ignored or replaced.
  void note(std::string text);
  /// Adds a parameter that does not change the picture; owner is its element. All of them become one note.
  void noteWithoutEffect(const std::string& owner, const std::string& parameter);

  /// Adds a file that the scene names, so that no output replaces it.
  void addFile(const std::filesystem::path& path) { files_.insert(path); }

  std::vector<std::filesystem::path> files() const { return {files_.begin(), files_.end()}; }
  const std::vector<Fault>& faults() const { return faults_; }
  std::vector<std::string> warnings() const;
  std::vector<std::string> notes() const;

 private:
  void leaveOut(std::string where);

  struct Warning {
    std::string where, message;
    std::size_t count;
  };
  struct WithoutEffect {
    std::string owner;
    std::vector<std::string> parameters;
  };
  std::map<std::string, std::size_t> faultOfKind_, warningOfKind_, withoutEffectOf_;  // indices
  std::set<std::pair<std::size_t, std::string>> places_;                              // of faults, by their index
  std::set<std::string> knownNotes_;
  std::set<std::pair<std::string, std::string>> knownWithoutEffect_;  // owner and parameter
  std::set<std::filesystem::path> files_;
  std::vector<Fault> faults_;
  std::vector<Warning> warnings_;
  std::vector<std::string> notes_;
  std::vector<WithoutEffect> withoutEffect_;
};

}  // namespace lobe
