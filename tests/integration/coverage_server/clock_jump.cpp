// SPDX-License-Identifier: Apache-2.0
// Preloaded into a process: its wall clock is ahead by the seconds that the file named by
// SIGHTLINE_CLOCK_JUMP_FILE holds, as it is at the moment. Monotonic clocks are as they are.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include <cstdlib>

namespace {

long JumpSeconds() {
  const char* file = std::getenv("SIGHTLINE_CLOCK_JUMP_FILE");
  if (file == nullptr) return 0;
  const int fd = open(file, O_RDONLY | O_CLOEXEC);
  if (fd < 0) return 0;
  char text[32] = {};
  const ssize_t got = read(fd, text, sizeof(text) - 1);
  close(fd);
  return got > 0 ? std::atol(text) : 0;
}

}  // namespace

extern "C" int clock_gettime(clockid_t clock, timespec* time) noexcept {
  using Function = int (*)(clockid_t, timespec*);
  static const auto real = reinterpret_cast<Function>(dlsym(RTLD_NEXT, "clock_gettime"));
  const int result = real(clock, time);
  if (result == 0 && clock == CLOCK_REALTIME) time->tv_sec += JumpSeconds();
  return result;
}

extern "C" int gettimeofday(timeval* time, void* zone) noexcept {
  timespec now{};
  const int result = clock_gettime(CLOCK_REALTIME, &now);
  (void)zone;
  time->tv_sec = now.tv_sec;
  time->tv_usec = now.tv_nsec / 1000;
  return result;
}
