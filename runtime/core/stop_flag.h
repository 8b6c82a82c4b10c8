#pragma once
// How long work is asked to end early, and how it says that it has.

#include <atomic>
#include <stdexcept>

namespace lobe {

/// Set to a value other than 0, from a signal handler or another thread, to end long work early.
using StopFlag = std::atomic<int>;

/// Thrown by work that has ended early because of a StopFlag. The message says what was done and what was not.
class Stopped : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace lobe
