#pragma once
// What all command-line tools share: exit codes, one-line errors, progress, tables. Results go to stdout,
// diagnostics to stderr.

#include <chrono>
#include <cstdio>
#include <functional>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace lobe {

/// The command line asks for something that makes no sense; runTool prints it and exits with 2.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// An option that had another name in the version before. values: the old values that have new names, too.
struct RenamedOption {
  std::string before, now;
  std::map<std::string, std::string> values = {};
};

/// Runs a tool: declare adds options to the CLI::App, which parses argv, then work runs. Returns the exit code: 0 done
/// (also after --help and --version); 1 when work throws; 2 when parsing fails or anything throws UsageError. Errors
/// go to stderr, "NAME: error: " before each line of their message. Renamed options are accepted with a note.
int runTool(const std::string& name, const std::string& description, int argc, char** argv,
            const std::function<void(CLI::App&)>& declare, const std::function<void()>& work,
            const std::vector<RenamedOption>& renamed = {});

/// Prints "NAME: warning: MESSAGE" to stderr.
void printWarning(const std::string& name, const std::string& message);

/// Prints "NAME: note: MESSAGE" to stderr.
void printNote(const std::string& name, const std::string& message);

/// -D name=value, any number of times, into definitions.
void addDefinitions(CLI::App& app, std::map<std::string, std::string>& definitions);

/// --threads N, at least 1; threads keeps its value (0: all cores) when the option is not given.
void addThreads(CLI::App& app, int& threads);

/// Progress of long work on stderr. On a terminal one line is redrawn at most five times a second, with the time left;
/// elsewhere a plain line is printed every ten seconds and nothing for shorter work. advance may be called from any
/// thread. The destructor ends the line.
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

/// Columns of text aligned by the widest cell: the first leftColumns to the left, the others to the right.
class Table {
 public:
  explicit Table(std::vector<std::string> header, std::size_t leftColumns = 1);
  /// As many cells as the header has.
  void add(std::vector<std::string> cells);
  void print(std::FILE* out) const;

 private:
  std::vector<std::vector<std::string>> rows_;
  std::size_t leftColumns_;
};

}  // namespace lobe
