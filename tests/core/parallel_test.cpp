#include <atomic>
#include <chrono>
#include <thread>

#include <tbb/global_control.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>
#include <catch2/catch.hpp>

#include "runtime/core/parallel.h"

namespace lobe {
namespace {

/// Returns when the condition holds, or after ten seconds.
template <class Condition>
void await(const Condition& condition) {
  const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (!condition() && std::chrono::steady_clock::now() < limit) std::this_thread::yield();
}

TEST_CASE("core: a thread that waits in an isolated function runs no tasks from outside of it") {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 3);
  std::atomic<int> iterations = 0, others = 0, outside = 0;
  std::atomic<bool> inside = true, started = false, spawned = false;
  tbb::task_arena(3).execute([&] {
    const std::thread::id caller = std::this_thread::get_id();
    tbb::task_group host;
    // A thread offers tasks when the two others are in the loop below.
    host.run([&] {
      started = true;
      await([&] { return iterations == 2; });
      for (int i = 0; i < 100; ++i)
        host.run([&] { outside += inside && std::this_thread::get_id() == caller ? 1 : 0; });
      spawned = true;
      await([&] { return !inside; });
    });
    await([&] { return started.load(); });
    const int result = isolated([&] {
      parallelForEach(0, 2, [&](int) {
        ++iterations;
        await([&] { return spawned.load(); });
        if (std::this_thread::get_id() == caller) return;
        ++others;
        // The caller now waits for this thread.
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
      });
      return 7;
    });
    inside = false;
    host.wait();
    CHECK(result == 7);
  });
  CHECK(iterations == 2);
  CHECK(others == 1);
  CHECK(outside == 0);
}

}  // namespace
}  // namespace lobe
