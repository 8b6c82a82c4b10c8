#pragma once
// What reading a scene file finds: faults, warnings and notes, each with its place.

#include <cstddef>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

namespace lobe {

/// Something in a scene file that is wrong or not known.
struct Fault {
  std::string where;        ///< "FILE:LINE:COLUMN"; for a file that cannot be opened, its path
  std::string message;      ///< what was found, and what is known or expected
  std::string consequence;  ///< what lenient reading does instead; empty: it cannot go on
  std::size_t count = 1;    ///< of faults of this kind; the place is that of the first

  /// One line: place, message, and what --lenient would do.
  std::string text() const;
};

/// One or several faults of a scene file. what() has a line for each of them, at most ten, and, where there are
/// several, one more that counts them and names --lenient and --check.
class SceneError : public std::runtime_error {
 public:
  SceneError(std::string where, std::string message);
  /// None: what cannot be read depends on something that is a fault already.
  explicit SceneError(std::vector<Fault> all);

  const std::vector<Fault>& faults() const { return faults_; }

 private:
  std::vector<Fault> faults_;
};

/// Collects what is found, in the order of the file. Findings of one kind are counted, and only the first is kept.
class Findings {
 public:
  void fault(std::string where, const std::string& kind, std::string message, std::string consequence);
  /// Something that is read, but not as it stands. The message says what was found and what is done instead.
  void warn(const std::string& where, const std::string& kind, const std::string& message);
  /// Something that is replaced by something of ours.
  void note(std::string text);
  /// A parameter that does not change the picture; owner is the element it stands in. All of them become one note.
  void noteWithoutEffect(const std::string& owner, const std::string& parameter);

  const std::vector<Fault>& faults() const { return faults_; }
  std::vector<std::string> warnings() const;
  std::vector<std::string> notes() const;

 private:
  struct Warning {
    std::string where, message;
    std::size_t count;
  };
  struct WithoutEffect {
    std::string owner;
    std::vector<std::string> parameters;
  };
  std::map<std::string, std::size_t> faultOfKind_, warningOfKind_;  // indices
  std::set<std::string> places_;                                    // of faults, with their kinds
  std::vector<Fault> faults_;
  std::vector<Warning> warnings_;
  std::vector<std::string> notes_;
  std::vector<WithoutEffect> withoutEffect_;
};

}  // namespace lobe
