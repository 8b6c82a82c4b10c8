// A library for LD_PRELOAD: when a program waits for a file to be on the disk, it gets SIGTERM twice, the second time
// because the first one may only ask it to end its work. A temporary file exists at that moment.

#include <csignal>

extern "C" int fsync(int) {
  for (int i = 0; i < 2; ++i) std::raise(SIGTERM);
  return 0;
}
