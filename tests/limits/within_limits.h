// SPDX-License-Identifier: Apache-2.0
// Work on input made to be expensive, in a process of its own with limits.
#pragma once

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <new>
#include <string>

#include "absl/strings/str_cat.h"

namespace sightline {

// Builds that take longer for everything. For the thread sanitizer the build sets the second macro,
// see cmake/Toolchain.cmake.
#if defined(__SANITIZE_ADDRESS__) || defined(_GLIBCXX_TSAN) || !defined(__OPTIMIZE__)
inline constexpr int kSlowness = 20;
#else
inline constexpr int kSlowness = 1;
#endif

struct WorkLimits {
  int cpu_time_s = 10;
  // Address space beyond the test's present use. It is not limited with sanitizers, which reserve
  // terabytes.
  int64_t memory_bytes = int64_t{1} << 30;
};

inline int64_t AddressSpaceBytes() {
  std::FILE* const file = std::fopen("/proc/self/statm", "r");
  long pages = 0;
  if (file != nullptr && std::fscanf(file, "%ld", &pages) != 1) pages = 0;
  if (file != nullptr) std::fclose(file);
  return int64_t{pages} * sysconf(_SC_PAGESIZE);
}

// The result of `work` (up to 4000 bytes), or how it went beyond the limits.
inline std::string WithinLimits(const WorkLimits& limits,
                                const std::function<std::string()>& work) {
  int ends[2];
  if (pipe(ends) != 0) return "no pipe";
  const pid_t child = fork();
  if (child < 0) return "no process";
  if (child == 0) {
    close(ends[0]);
    const int cpu_time_s = kSlowness * limits.cpu_time_s;
    const rlimit cpu = {static_cast<rlim_t>(cpu_time_s), static_cast<rlim_t>(cpu_time_s)};
    setrlimit(RLIMIT_CPU, &cpu);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    const rlim_t bytes = static_cast<rlim_t>(AddressSpaceBytes() + limits.memory_bytes);
    const rlimit memory = {bytes, bytes};
    setrlimit(RLIMIT_AS, &memory);
#endif
    std::string said;
    try {
      said = work();
    } catch (const std::bad_alloc&) {
      said = "out of memory";
    }
    said.resize(std::min<size_t>(said.size(), 4000));
    const ssize_t written = write(ends[1], said.data(), said.size());
    _exit(written == static_cast<ssize_t>(said.size()) ? 0 : 1);
  }
  close(ends[1]);
  std::string said;
  char buffer[512];
  ssize_t count = 0;
  while ((count = read(ends[0], buffer, sizeof(buffer))) > 0) {
    said.append(buffer, static_cast<size_t>(count));
  }
  close(ends[0]);
  int state = 0;
  waitpid(child, &state, 0);
  if (WIFSIGNALED(state)) return absl::StrCat("ended by signal ", WTERMSIG(state));
  return said;
}

}  // namespace sightline
