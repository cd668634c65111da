// SPDX-License-Identifier: Apache-2.0
#include "core/process/process_clock.h"

#include <time.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr absl::Duration kShortestLook = absl::Milliseconds(2);
constexpr absl::Duration kLongestSleep = absl::Seconds(1);

// CPU time of all threads of a process; zero if the process has ended.
absl::Duration CpuTime(pid_t pid) {
  clockid_t clock;
  timespec time;
  if (clock_getcpuclockid(pid, &clock) != 0 || clock_gettime(clock, &time) != 0) {
    return absl::ZeroDuration();
  }
  return absl::DurationFromTimespec(time);
}

// The state letter of "pid (name) state ...", where the name may contain anything.
char ThreadState(const fs::path& stat_file) {
  std::ifstream file(stat_file);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const size_t name_end = text.rfind(')');
  return name_end == std::string::npos || name_end + 2 >= text.size() ? '?' : text[name_end + 2];
}

// Whether a thread of it runs or is ready to (R), or waits for the disk (D).
bool NeedsTheMachine(pid_t pid) {
  std::error_code error;
  fs::directory_iterator thread(absl::StrCat("/proc/", pid, "/task"), error);
  for (; !error && thread != fs::directory_iterator(); thread.increment(error)) {
    const char state = ThreadState(thread->path() / "stat");
    if (state == 'R' || state == 'D') return true;
  }
  return false;
}

}  // namespace

ProcessClock::ProcessClock(pid_t pid)
    : pid_(pid), cpu_time_(CpuTime(pid)), looked_at_(std::chrono::steady_clock::now()) {}

absl::Duration ProcessClock::Look() {
  const auto now = std::chrono::steady_clock::now();
  const absl::Duration passed = absl::FromChrono(now - looked_at_);
  if (passed < kShortestLook) return taken_;
  const absl::Duration cpu_time = std::max(CpuTime(pid_), cpu_time_);
  // Threads that run at the same time share the time that passes.
  absl::Duration taken = std::min(cpu_time - cpu_time_, passed);
  if (!NeedsTheMachine(pid_)) taken = std::max(taken, std::min(passed, kLongestSleep));
  looked_at_ = now;
  cpu_time_ = cpu_time;
  taken_ += taken;
  return taken_;
}

}  // namespace sightline
