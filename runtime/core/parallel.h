#pragma once
// Parallel loops and sorting that either complete or throw.

#include <algorithm>
#include <cstddef>
#include <exception>
#include <stdexcept>
#include <vector>

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
#endif
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_sort.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

namespace lobe {

/// Thrown when a loop is cancelled because an enclosing parallel loop or task failed, so that some iterations did not
/// run.
class LoopCancelled : public std::runtime_error {
 public:
  LoopCancelled() : std::runtime_error("cancelled by the failure of a parallel task") {}
};

/// Throws LoopCancelled if this runs in a loop or task that has been cancelled: for long work that is not a loop.
inline void throwIfCancelled() {
  if (tbb::is_current_task_group_canceling()) throw LoopCancelled();
}

/// Tells the thread sanitizer, which does not see into the library of oneTBB, that the bodies of a loop run after what
/// precedes the loop and before what follows it, but in no order among each other. Does nothing without it.
class ForkJoin {
 public:
  ForkJoin(const ForkJoin&) = delete;
  ForkJoin& operator=(const ForkJoin&) = delete;
#if defined(__SANITIZE_THREAD__)
  ForkJoin() {
    __tsan_release(&fork_);
  }
  ~ForkJoin() {
    __tsan_acquire(&join_);
  }
  template <class Body, class... Arguments>
  void run(const Body& body, const Arguments&... arguments) {
    __tsan_acquire(&fork_);
    const Release release{&join_};
    body(arguments...);
  }

 private:
  struct Release {
    ~Release() { __tsan_release(join); }
    char* join;
  };
  char fork_ = 0, join_ = 0;
#else
  ForkJoin() = default;
  template <class Body, class... Arguments>
  void run(const Body& body, const Arguments&... arguments) {
    body(arguments...);
  }
#endif
};

/// Calls body(i) for every i in [begin, end) in parallel. Rethrows the exception of an iteration. If an exception in an
/// enclosing loop cancels this one, tbb::parallel_for returns normally although some iterations did not run; this
/// function throws LoopCancelled instead, so that incomplete results are never used.
template <class Index, class Body>
void parallelFor(Index begin, Index end, const Body& body) {
  tbb::task_group_context context;  // bound to the enclosing loop, if there is one, and cancelled with it
  ForkJoin order;
  tbb::parallel_for(
      begin, end, [&](Index i) { order.run(body, i); }, context);
  if (context.is_group_execution_cancelled()) throw LoopCancelled();
}

/// Sorts a range with random access by an order in which no two elements are equivalent, so that the result does not
/// depend on threads. Throws LoopCancelled like parallelFor.
template <class Range, class Less>
void parallelSort(Range& range, const Less& less) {
#if defined(__SANITIZE_THREAD__)
  std::sort(range.begin(), range.end(), less);  // has the same result
#else
  tbb::parallel_sort(range.begin(), range.end(), less);
#endif
  throwIfCancelled();
}

/// The same as parallelFor, with one task for each iteration, for iterations that take long.
template <class Index, class Body>
void parallelForEach(Index begin, Index end, const Body& body) {
  tbb::task_group_context context;
  ForkJoin order;
  const auto run = [&](const tbb::blocked_range<Index>& range) {
    for (Index i = range.begin(); i != range.end(); ++i) order.run(body, i);
  };
  tbb::parallel_for(tbb::blocked_range<Index>(begin, end, 1), run, tbb::simple_partitioner(), context);
  if (context.is_group_execution_cancelled()) throw LoopCancelled();
}

/// Calls body(i) for every i < count in parallel. Unlike with parallelFor, the exception of an iteration does not
/// cancel the others. Returns the exception of each iteration; null if there is none. Throws LoopCancelled if the loop
/// or an iteration is cancelled from outside, because that is no failure of the iteration.
template <class Body>
std::vector<std::exception_ptr> parallelAttempts(std::size_t count, const Body& body) {
  std::vector<std::exception_ptr> failures(count);
  parallelFor(std::size_t{0}, count, [&](std::size_t i) {
    try {
      body(i);
    } catch (const LoopCancelled&) {
      throw;
    } catch (...) {
      failures[i] = std::current_exception();
    }
  });
  return failures;
}

/// Calls the functions in parallel. Throws like parallelFor.
template <class... Functions>
void parallelInvoke(const Functions&... functions) {
  tbb::task_group_context context;
  ForkJoin order;
  tbb::parallel_invoke([&] { order.run(functions); }..., context);
  if (context.is_group_execution_cancelled()) throw LoopCancelled();
}

/// Returns f(). A thread that waits for a loop of f in the meantime runs no tasks from outside of f: in a library,
/// those would be tasks of the host, which may hold locks or use thread-local data.
template <class Function>
auto isolated(const Function& f) {
  return tbb::this_task_arena::isolate(f);
}

}  // namespace lobe
