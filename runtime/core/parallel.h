#pragma once
// Parallel loops whose results may be used when they return.

#include <stdexcept>

#include <tbb/parallel_for.h>
#include <tbb/task_group.h>

namespace lobe {

/// A loop was cancelled because an enclosing parallel loop or task failed: some of its iterations did not run.
class LoopCancelled : public std::runtime_error {
 public:
  LoopCancelled() : std::runtime_error("cancelled by the failure of a parallel task") {}
};

/// Calls body(i) for every i in [begin, end), in parallel. Throws what an iteration throws. tbb::parallel_for alone
/// returns normally when an exception elsewhere in an enclosing loop cancels it, although some iterations never ran;
/// this throws LoopCancelled instead, so that nobody takes a part of the results for all of them.
template <class Index, class Body>
void parallelFor(Index begin, Index end, const Body& body) {
  tbb::task_group_context context;  // bound to the enclosing loop, if there is one, and cancelled with it
  tbb::parallel_for(begin, end, body, context);
  if (context.is_group_execution_cancelled()) throw LoopCancelled();
}

}  // namespace lobe
