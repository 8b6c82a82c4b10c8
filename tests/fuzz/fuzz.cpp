// The entry points of libFuzzer. The environment variable LOBE_FUZZ_TARGET selects the reader. A crash, an error found
// by the sanitizers, and more time or memory than the limits given to libFuzzer are findings.

#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "tests/fuzz/fuzz_targets.h"

namespace {

const lobe::fuzz::FuzzTarget& target() {
  const lobe::fuzz::FuzzTargets& targets = lobe::fuzz::fuzzTargets();
  const char* name = std::getenv("LOBE_FUZZ_TARGET");
  const auto found = name ? targets.find(name) : targets.end();
  if (found != targets.end()) return found->second;
  std::fprintf(stderr, "LOBE_FUZZ_TARGET must be one of:");
  for (const auto& [known, read] : targets) std::fprintf(stderr, " %s", known.c_str());
  std::fprintf(stderr, "\n");
  std::exit(2);
}

}  // namespace

// NOLINTNEXTLINE(readability-identifier-naming)
extern "C" int LLVMFuzzerInitialize(int*, char***) {
  target();
  return 0;
}

// NOLINTNEXTLINE(readability-identifier-naming)
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const lobe::fuzz::FuzzTarget& read = target();
  lobe::fuzz::readOrRefuse(read, std::as_bytes(std::span(data, size)));
  return 0;
}
