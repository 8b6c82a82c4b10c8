#pragma once
// Fault injection: makes the n-th allocation, task, write or read of this program fail, and checks what is left.

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>

namespace lobe::test {

/// Calls of one kind that are counted while an Injection exists; call number `failing` fails.
struct Countdown {
  const char* name;
  std::atomic<long> calls = 0, failing = 0;
  std::atomic<bool> enabled = false;

  bool fails() { return enabled && ++calls == failing; }
};

/// Allocations by operator new; tasks that our parallel loops start; what writes a file, from opening it to renaming
/// it; and reads from files.
extern Countdown allocations, tasks, writes, reads;

class Injection {
 public:
  /// failing: number of the call that fails, from 1; 0: none.
  Injection(Countdown& countdown, long failing) : countdown_(countdown) {
    countdown.calls = 0;
    countdown.failing = failing;
    countdown.enabled = true;
  }
  Injection(const Injection&) = delete;
  Injection& operator=(const Injection&) = delete;
  ~Injection() { countdown_.enabled = false; }

 private:
  Countdown& countdown_;
};

/// The samples per pixel of the renders.
inline constexpr int kSamples = 2;

/// What faults are injected into.
struct Subject {
  std::string name;
  std::filesystem::path out;   ///< folder of its files, which is emptied before each call
  std::function<void()> work;  ///< throws std::exception if it fails
  /// What else it has computed.
  std::function<std::string()> result = [] { return std::string(); };
};

/// Calls the work with each of many chosen calls failing. Checks that it then either throws, and leaves only complete
/// files, or has the same files and the same result as without a fault. A render that fails may leave a picture of
/// fewer samples that says so. Prints the numbers of faults, and returns in how many cases the work threw.
int inject(Countdown& countdown, const Subject& subject);

}  // namespace lobe::test
