#pragma once
// Common parts of all command-line tools: exit codes, one-line errors, progress, tables. Results go to stdout,
// diagnostics to stderr.

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/core/stop_flag.h"

namespace CLI {  // NOLINT(readability-identifier-naming)
class App;
}

namespace lobe {

/// An invalid command line; runTool prints the message and returns exit code 2.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// An option whose name changed in this version. values maps old values to new ones.
struct RenamedOption {
  std::string before, now;
  std::map<std::string, std::string> values = {};
};

/// Runs a tool: declare adds options to the CLI::App, which parses argv, then work runs. Returns the exit code: 0 on
/// success (also after --help and --version); 1 if work throws; 2 if parsing fails, the value of an option is empty, or
/// anything throws UsageError.
/// Errors go to stderr, with "NAME: error: " before each line of the message. Renamed options are accepted with a note.
/// If work throws Stopped, its message is printed and the result is 128 plus the number of the signal.
int runTool(const std::string& name, std::string_view description, int argc, char** argv,
            const std::function<void(CLI::App&)>& declare, const std::function<void()>& work,
            const std::vector<RenamedOption>& renamed = {});

/// Prints text to stderr. Failures are ignored, because they must not end the work.
void printDiagnostic(std::string_view text);

/// A flag that holds the number of the first SIGINT or SIGTERM after this call, for work that can end early and leave
/// complete files. The second one ends the program. Ignored signals stay ignored.
const StopFlag& stopOnSignals();

/// Prints "NAME: warning: MESSAGE" to stderr.
void printWarning(const std::string& name, const std::string& message);

/// Prints "NAME: note: MESSAGE" to stderr.
void printNote(const std::string& name, const std::string& message);

/// Quotes the word for the shell if necessary.
std::string shellQuoted(const std::string& word);

/// Whether two names are those of one file: also hard links, and symbolic links, whose target need not exist.
bool isSameFile(const std::filesystem::path& a, const std::filesystem::path& b);

/// Throws UsageError if writing an output would overwrite one of the inputs or another output (isSameFile). Empty paths
/// are ignored.
void checkOutputs(const std::vector<std::filesystem::path>& outputs, const std::vector<std::filesystem::path>& inputs);

/// Collects the errors of outputs, so that one that fails does not prevent the others.
class OutputErrors {
 public:
  /// Calls `write`; if it throws, its message is added to the errors, unless it is that of the error before, as if a
  /// folder for several files cannot be created. Returns whether it succeeded.
  bool attempt(const std::filesystem::path& path, const std::function<void()>& write);
  const std::vector<std::string>& all() const { return errors_; }
  /// Throws std::runtime_error with one line for each error, if there are any.
  void throwIfAny() const;

 private:
  void add(const std::string& message);

  std::vector<std::string> errors_;
};

/// Adds the option -D NAME=VALUE, which may be repeated and fills definitions.
void addDefinitions(CLI::App& app, std::map<std::string, std::string>& definitions);

/// Adds the option --threads N with N ≥ 1; threads keeps its value (0: all cores) if the option is not given.
void addThreads(CLI::App& app, int& threads);

/// Shows the progress of long work on stderr. On a terminal, one line with the remaining time is redrawn up to five
/// times per second; otherwise a new line is printed every ten seconds, and nothing for shorter work. advance may be
/// called from any thread. The destructor ends the line.
class Progress {
 public:
  Progress(std::string label, double total);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void advance(double n = 1);

 private:
  using Clock = std::chrono::steady_clock;
  void print(Clock::time_point now);

  std::mutex mutex_;
  std::string label_;
  double total_;
  double done_ = 0;
  bool terminal_;
  std::size_t drawn_ = 0;  // width of the line on the terminal
  Clock::time_point start_;
  Clock::time_point next_;
};

/// A text table. The first leftColumns columns are aligned to the left, the others to the right.
class Table {
 public:
  explicit Table(std::vector<std::string> header, std::size_t leftColumns = 1);
  /// Adds a row, which must have the same number of cells as the header.
  void add(std::vector<std::string> cells);
  void print(std::FILE* out) const;

 private:
  std::vector<std::vector<std::string>> rows_;
  std::size_t leftColumns_;
};

}  // namespace lobe
