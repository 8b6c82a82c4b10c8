#pragma once
// Interruption of long work from outside, for example by a signal.

#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <stop_token>
#include <thread>
#include <utility>

#include <tbb/task_group.h>

#include "runtime/core/parallel.h"
#include "runtime/core/stop_flag.h"

namespace lobe {

/// Cancels the parallel loops of a task group soon after the flag is set.
class CancelOnStop {
 public:
  CancelOnStop(const StopFlag& flag, tbb::task_group_context& context)
      : thread_([this, &flag, &context](const std::stop_token& end) {
          std::unique_lock lock(mutex_);
          while (flag == 0 && !end.stop_requested())
            ended_.wait_for(lock, end, std::chrono::milliseconds(20), [] { return false; });
          if (flag != 0) context.cancel_group_execution();
        }) {}

 private:
  // Making these needs memory, so it is not done in the thread, whose exceptions would end the program.
  std::mutex mutex_;
  std::condition_variable_any ended_;
  std::jthread thread_;
};

/// Runs work(), and throws Stopped(message) instead if the flag is set before it has completed. Its loops by
/// parallelFor then end after the iterations that have begun, with LoopCancelled; so work that ends early never looks
/// complete. Other exceptions pass, unless the flag is set: then they may be consequences of it, because libraries that
/// use oneTBB report cancelled loops as errors of their own.
template <class Work>
void stoppable(const StopFlag& flag, const char* message, const Work& work) {
  tbb::task_group_context context(tbb::task_group_context::isolated);
  tbb::task_group group(context);
  std::exception_ptr failure;
  bool completed = false;
  {
    const CancelOnStop canceller(flag, context);
    // An exception that left the task would be lost if the group has been cancelled.
    if (flag == 0)
      group.run_and_wait([&] {
        try {
          work();
          completed = true;
        } catch (...) {
          failure = std::current_exception();
        }
      });
  }
  if (completed) return;
  if (flag != 0) throw Stopped(message);
  std::rethrow_exception(failure);
}

}  // namespace lobe
