#include "runtime/tools/tool.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>
#include <iostream>
#include <new>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>
#include <variant>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include "runtime/core/atomic_file.h"
#include "runtime/core/files.h"

namespace lobe {
namespace {

/// Opens closed standard streams, so that no other file gets their descriptors and receives what is printed to them.
/// Printing to the replacement of stdout fails, as it should.
void openClosedStreams() {
  int file = 0;
  do {
    file = ::open("/dev/null", O_RDONLY);
  } while (file >= 0 && file <= STDERR_FILENO);
  if (file >= 0) ::close(file);
}

/// Makes a write beyond a file size limit and a write to a closed pipe fail with an error instead of ending the
/// program.
void ignoreSignalsOfWrites() {
  for (const int signal : {SIGXFSZ, SIGPIPE}) std::signal(signal, SIG_IGN);
}

/// Whether the program has been started with the signal ignored, as background jobs of shells are.
bool isIgnored(int signal) {
  struct sigaction action {};
  ::sigaction(signal, nullptr, &action);
  return action.sa_handler == SIG_IGN;
}

/// Makes signals that end the program leave no temporary files.
void deferSignalsWhileWriting() {
  for (const int signal : {SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGXCPU})
    if (!isIgnored(signal)) endAfterWriting(signal);
}

/// Throws std::system_error if something printed to stdout could not be written.
void flushOutput() {
  std::cout.flush();
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return;
  throw std::system_error(errno, std::generic_category(), "cannot write to standard output");
}

int fail(const std::string& name, std::string_view message, int code) {
  while (!message.empty()) {
    const std::size_t end = std::min(message.find('\n'), message.size());
    printDiagnostic(fmt::format("{}: error: {}\n", name, message.substr(0, end)));
    message.remove_prefix(std::min(end + 1, message.size()));
  }
  return code;
}

/// The signal that has asked the tool to stop; 0: none.
StopFlag stopSignal = 0;
static_assert(StopFlag::is_always_lock_free, "it is set by a signal handler");

/// The next signal ends the program. Signals that are ignored stay so.
extern "C" void requestStop(int signal) {
  stopSignal = signal;
  for (const int other : {SIGINT, SIGTERM}) {
    struct sigaction action {};
    ::sigaction(other, nullptr, &action);
    if (action.sa_handler == requestStop) endAfterWriting(other);
  }
}

/// Ends the program like SIGPIPE does by default, without a message, because the reader of its output has ended.
int endWithReader() {
  std::signal(SIGPIPE, SIG_DFL);
  std::raise(SIGPIPE);
  return 128 + SIGPIPE;  // if the signal is blocked
}

/// For messages of libraries, which may have several lines.
std::string asOneLine(std::string message) {
  std::ranges::replace(message, '\n', ' ');
  return message;
}

/// The remaining time is not shown before this fraction of the work is done, because the first steps are not
/// representative.
constexpr double kMinFractionToExtrapolate = 0.02;

/// Number of code points, which is the width of the text on a terminal for the characters that the tools print.
std::size_t displayWidth(const std::string& text) {
  return static_cast<std::size_t>(std::ranges::count_if(text, [](char c) { return (c & 0xc0) != 0x80; }));
}

std::string formatSeconds(double seconds) {
  seconds = std::round(seconds);
  if (seconds < 60) return fmt::format("{:.0f} s", seconds);
  if (seconds < 3600) return fmt::format("{:.0f} min {:02.0f} s", std::floor(seconds / 60), std::fmod(seconds, 60));
  return fmt::format("{:.0f} h {:02.0f} min", std::floor(seconds / 3600), std::floor(std::fmod(seconds, 3600) / 60));
}

/// Replaces the old name and the old values of an option, and prints a note.
void takeRenamed(const std::string& tool, const RenamedOption& option, std::vector<std::string>& arguments) {
  const auto renameValue = [&](std::string& value) {
    if (const auto found = option.values.find(value); found != option.values.end()) value = found->second;
  };
  for (std::size_t i = 0; i < arguments.size() && arguments[i] != "--"; ++i) {
    const std::size_t equals = arguments[i].find('=');
    if (arguments[i].substr(0, equals) != option.before) continue;
    if (equals != std::string::npos) {
      std::string value = arguments[i].substr(equals + 1);
      renameValue(value);
      arguments[i] = option.now + "=" + value;
    } else {
      arguments[i] = option.now;
      if (i + 1 < arguments.size()) renameValue(arguments[i + 1]);
    }
    printNote(tool, fmt::format("{} has been renamed to {}; the next version will not accept the old name",
                                option.before, option.now));
  }
}

/// A validator of CLI11 for values that must not be empty, as those of shell variables are that are not set.
CLI::Validator notEmpty() {
  const auto check = [](const std::string& text) { return std::string(text.empty() ? "must not be empty" : ""); };
  return {check, ""};
}

/// Declares the options and parses the arguments. Returns false after --help and --version, which print a text.
bool parse(CLI::App& app, const std::string& name, int argc, char** argv, const std::function<void(CLI::App&)>& declare,
           const std::vector<RenamedOption>& renamed) {
  app.option_defaults()->always_capture_default();
  app.set_version_flag("--version", name + " " LOBE_VERSION);
  declare(app);
  for (CLI::Option* option : app.get_options()) option->check(notEmpty());
  std::vector<std::string> arguments(argv + std::min(argc, 1), argv + argc);
  for (const RenamedOption& option : renamed) takeRenamed(name, option, arguments);
  std::ranges::reverse(arguments);  // CLI11 expects the arguments in reverse order
  try {
    app.parse(arguments);
    return true;
  } catch (const CLI::Success& request) {
    app.exit(request);
    flushOutput();
    return false;
  }
}

/// Device and inode of a file that exists; otherwise where writing would create it.
using FileIdentity = std::variant<std::pair<dev_t, ino_t>, std::filesystem::path>;

FileIdentity identityOf(const std::filesystem::path& path) {
  struct stat status;
  if (::stat(path.c_str(), &status) == 0) return std::pair(status.st_dev, status.st_ino);
  std::error_code error;
  const std::filesystem::path created = std::filesystem::absolute(followLinks(path), error);
  const std::filesystem::path place = std::filesystem::weakly_canonical(created, error);
  return error ? created : place;
}

}  // namespace

void printDiagnostic(std::string_view text) {
  std::fwrite(text.data(), 1, text.size(), stderr);
}

const StopFlag& stopOnSignals() {
  for (const int signal : {SIGINT, SIGTERM}) {
    if (isIgnored(signal)) continue;
    struct sigaction action {};
    action.sa_handler = requestStop;
    action.sa_flags = SA_RESTART;
    ::sigaction(signal, &action, nullptr);
  }
  return stopSignal;
}

int runTool(const std::string& name, std::string_view description, int argc, char** argv,
            const std::function<void(CLI::App&)>& declare, const std::function<void()>& work,
            const std::vector<RenamedOption>& renamed) {
  openClosedStreams();
  ignoreSignalsOfWrites();
  deferSignalsWhileWriting();
  try {
    CLI::App app(std::string(description), name);
    if (!parse(app, name, argc, argv, declare, renamed)) return 0;
    work();
    flushOutput();
    return 0;
  } catch (const CLI::ParseError& e) {
    return fail(name, asOneLine(fmt::format("{} (see {} --help)", e.what(), name)), 2);
  } catch (const UsageError& e) {
    return fail(name, e.what(), 2);
  } catch (const Stopped& e) {
    printDiagnostic(fmt::format("{}: interrupted: {}\n", name, e.what()));
    return 128 + stopSignal;
  } catch (const OutOfMemory& e) {
    return fail(name, e.what(), 1);
  } catch (const std::bad_alloc&) {
    return fail(name, "out of memory", 1);
  } catch (const std::system_error& e) {
    if (e.code() == std::errc::broken_pipe) return endWithReader();
    // The message of fmt::print does not name the file; the tools print to no other one.
    const bool isOutput = std::ferror(stdout) != 0;
    return fail(name, isOutput ? "cannot write to standard output: " + e.code().message() : e.what(), 1);
  } catch (const std::exception& e) {
    return fail(name, e.what(), 1);
  }
}

void printWarning(const std::string& name, const std::string& message) {
  printDiagnostic(fmt::format("{}: warning: {}\n", name, message));
}

void printNote(const std::string& name, const std::string& message) {
  printDiagnostic(fmt::format("{}: note: {}\n", name, message));
}

std::string shellQuoted(const std::string& word) {
  const auto safe = [](unsigned char c) { return std::isalnum(c) || c >= 0x80 || std::strchr("/._-=+,:@%", c); };
  if (!word.empty() && std::ranges::all_of(word, safe)) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? "'\\''" : std::string(1, c);
  return text + "'";
}

bool isSameFile(const std::filesystem::path& a, const std::filesystem::path& b) {
  return identityOf(a) == identityOf(b);
}

void checkOutputs(const std::vector<std::filesystem::path>& outputs, const std::vector<std::filesystem::path>& inputs) {
  std::set<FileIdentity> read, written;
  for (const std::filesystem::path& input : inputs)
    if (!input.empty()) read.insert(identityOf(input));
  for (const std::filesystem::path& output : outputs) {
    if (output.empty()) continue;
    const FileIdentity identity = identityOf(output);
    if (read.contains(identity))
      throw UsageError(fmt::format("{}: is both an input and an output, and would be overwritten", output.string()));
    if (!written.insert(identity).second)
      throw UsageError(fmt::format("{}: is used for more than one output, and would be overwritten", output.string()));
  }
}

bool OutputErrors::attempt(const std::filesystem::path& path, const std::function<void()>& write) {
  try {
    write();
    return true;
  } catch (const OutOfMemory& e) {
    add(e.what());
  } catch (const std::bad_alloc&) {
    add(path.string() + ": not enough memory");
  } catch (const std::exception& e) {
    add(e.what());
  }
  return false;
}

void OutputErrors::add(const std::string& message) {
  if (errors_.empty() || errors_.back() != message) errors_.push_back(message);
}

void OutputErrors::throwIfAny() const {
  if (!errors_.empty()) throw std::runtime_error(fmt::format("{}", fmt::join(errors_, "\n")));
}

void addDefinitions(CLI::App& app, std::map<std::string, std::string>& definitions) {
  const auto parse = [&definitions](const std::string& text) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0)
      throw CLI::ValidationError("-D", "expected name=value, not '" + text + "'");
    definitions[text.substr(0, equals)] = text.substr(equals + 1);
  };
  app.add_option_function<std::string>("-D", parse, "Set the scene parameter $NAME to VALUE (repeatable)")
      ->type_name("NAME=VALUE")
      ->trigger_on_parse()
      ->allow_extra_args(false);
}

void addThreads(CLI::App& app, int& threads) {
  app.add_option("--threads", threads, "Number of threads (default: all cores)")
      ->check(CLI::Range(1, 4096))
      ->default_str("");
}

Progress::Progress(std::string label, double total)
    : label_(std::move(label)), total_(total), terminal_(isatty(STDERR_FILENO) != 0), start_(Clock::now()) {
  next_ = start_ + (terminal_ ? std::chrono::milliseconds(200) : std::chrono::seconds(10));
}

Progress::~Progress() {
  if (drawn_ > 0) printDiagnostic("\n");
}

void Progress::advance(double n) {
  const std::lock_guard lock(mutex_);
  done_ += n;
  const Clock::time_point now = Clock::now();
  const bool finished = drawn_ > 0 && done_ >= total_;
  if (now < next_ && !finished) return;
  next_ = now + (terminal_ ? std::chrono::milliseconds(200) : std::chrono::seconds(10));
  print(now);
}

void Progress::print(Clock::time_point now) {
  const double fraction = std::clamp(total_ > 0 ? done_ / total_ : 1.0, 0.0, 1.0);
  const double elapsed = std::chrono::duration<double>(now - start_).count();
  std::string line = fmt::format("{}: {:3.0f} %", label_, std::floor(100 * fraction));
  if (fraction >= 1)
    line += ", " + formatSeconds(elapsed);
  else if (fraction >= kMinFractionToExtrapolate)
    line += ", " + formatSeconds(elapsed * (1 - fraction) / fraction) + " left";
  if (!terminal_) {
    printDiagnostic(line + "\n");
    return;
  }
  const std::size_t width = displayWidth(line);
  printDiagnostic(fmt::format("\r{}{:{}}", line, "", std::max(drawn_, width) - width));
  drawn_ = width;
}

Table::Table(std::vector<std::string> header, std::size_t leftColumns) : leftColumns_(leftColumns) {
  rows_.push_back(std::move(header));
}

void Table::add(std::vector<std::string> cells) {
  rows_.push_back(std::move(cells));
}

void Table::print(std::FILE* out) const {
  std::vector<std::size_t> widths(rows_.front().size(), 0);
  for (const auto& row : rows_)
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], displayWidth(row[i]));
  for (const auto& row : rows_) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string padding(widths[i] - displayWidth(row[i]), ' ');
      line += (i == 0 ? "" : "  ") + (i < leftColumns_ ? row[i] + padding : padding + row[i]);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    fmt::print(out, "{}\n", line);
  }
}

}  // namespace lobe
