// Parallel loops that fail or are stopped never look complete.

#include <atomic>
#include <cstddef>
#include <exception>
#include <stdexcept>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>

#include "runtime/core/parallel.h"
#include "runtime/core/stop.h"

namespace lobe {
namespace {

constexpr int kCount = 200;

/// Calls loop(body) for each kind of parallel loop, where body takes an index and loop throws what the body throws.
template <class Loop>
void forEachKind(const Loop& loop) {
  loop([](const auto& body) { parallelFor(0, kCount, body); });
  loop([](const auto& body) { parallelForEach(0, kCount, body); });
  loop([](const auto& body) {
    const auto half = [&](int begin) {
      for (int i = begin; i < begin + kCount / 2; ++i) body(i);
    };
    parallelInvoke([&] { half(0); }, [&] { half(kCount / 2); });
  });
}

TEST_CASE("core: a parallel loop throws what any of its iterations throws") {
  forEachKind([](const auto& loop) {
    std::atomic<int> calls = 0;
    loop([&](int) { ++calls; });
    CHECK(calls == kCount);
    for (int failing = 0; failing < kCount; failing += 7)
      CHECK_THROWS_WITH(loop([&](int i) {
                          if (i == failing) throw std::runtime_error("injected");
                        }),
                        "injected");
  });
}

TEST_CASE("core: stopped work does not look complete, whichever loop it is in") {
  forEachKind([](const auto& loop) {
    for (const int moment : {1, 10, kCount - 1}) {
      StopFlag stop = 0;
      std::atomic<int> calls = 0;
      std::atomic<bool> after = false;
      const auto work = [&] {
        loop([&](int) {
          if (++calls == moment) stop = 2;
          std::this_thread::sleep_for(std::chrono::milliseconds(stop == 0 ? 0 : 30));
        });
        loop([](int) {});
        after = true;
      };
      try {
        stoppable(stop, "stopped early", work);
        CHECK(after);
        CHECK(calls == kCount);  // every iteration had begun before the loops were cancelled
      } catch (const Stopped& e) {
        CHECK(e.what() == std::string("stopped early"));
        CHECK_FALSE(after);
      }
    }
  });
}

TEST_CASE("core: failures of attempts are returned and do not cancel the others") {
  std::atomic<int> calls = 0;
  const std::vector<std::exception_ptr> failures = parallelAttempts(kCount, [&](std::size_t i) {
    ++calls;
    if (i % 2 == 1) throw std::runtime_error("injected");
  });
  CHECK(calls == kCount);
  REQUIRE(failures.size() == kCount);
  for (std::size_t i = 0; i < failures.size(); ++i) CHECK((failures[i] != nullptr) == (i % 2 == 1));
  CHECK_THROWS_WITH(std::rethrow_exception(failures[1]), "injected");
}

TEST_CASE("core: an attempt that is cancelled from outside is no failure of its own") {
  // Cancelling from outside reaches the loops inside an attempt and the one over the attempts in any order.
  CHECK_THROWS_AS(parallelAttempts(kCount,
                                   [](std::size_t i) {
                                     if (i == kCount - 1) throw LoopCancelled();
                                   }),
                  LoopCancelled);
}

TEST_CASE("core: work that is not stopped completes, and its errors pass") {
  StopFlag stop = 0;
  int done = 0;
  stoppable(stop, "stopped early", [&] { done = 1; });
  CHECK(done == 1);
  CHECK_THROWS_WITH(stoppable(stop, "stopped early", [] { throw std::runtime_error("injected"); }), "injected");
  stop = 15;
  CHECK_THROWS_AS(stoppable(stop, "stopped early", [&] { done = 2; }), Stopped);
  CHECK(done == 1);
}

}  // namespace
}  // namespace lobe
