// SPDX-License-Identifier: Apache-2.0
#include "core/process/process_clock.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <chrono>

#include "absl/time/clock.h"

namespace sightline {
namespace {

// A child that runs `work` until this goes.
class Child {
 public:
  template <typename Work>
  explicit Child(const Work& work) : pid_(fork()) {
    if (pid_ == 0) {
      alarm(600);
      while (true) work();
    }
  }
  ~Child() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  pid_t pid() const { return pid_; }

 private:
  pid_t pid_;
};

absl::Duration CpuTime(pid_t pid) {
  clockid_t clock;
  timespec time{};
  EXPECT_EQ(clock_getcpuclockid(pid, &clock), 0);
  EXPECT_EQ(clock_gettime(clock, &time), 0);
  return absl::DurationFromTimespec(time);
}

// All children that are made from now on share one processor.
void UseOneProcessor() {
  cpu_set_t all, one;
  ASSERT_EQ(sched_getaffinity(0, sizeof(all), &all), 0);
  CPU_ZERO(&one);
  for (int i = 0; i < CPU_SETSIZE && CPU_COUNT(&one) == 0; ++i) {
    if (CPU_ISSET(i, &all)) CPU_SET(i, &one);
  }
  ASSERT_EQ(sched_setaffinity(0, sizeof(one), &one), 0);
}

TEST(ProcessClock, WorkCountsAsTheProcessorTimeThatItGets) {
  cpu_set_t before;
  ASSERT_EQ(sched_getaffinity(0, sizeof(before), &before), 0);
  UseOneProcessor();
  const auto spin = [] {};
  const Child child(spin);
  const Child rival(spin);
  ASSERT_EQ(sched_setaffinity(0, sizeof(before), &before), 0);
  ASSERT_GT(child.pid(), 0);
  ASSERT_GT(rival.pid(), 0);
  ProcessClock clock(child.pid());
  const absl::Duration cpu_before = CpuTime(child.pid());
  const auto start = std::chrono::steady_clock::now();
  absl::Duration taken, cpu_time;
  while (cpu_time < absl::Milliseconds(300)) {
    absl::SleepFor(absl::Milliseconds(20));
    taken = clock.Look();
    cpu_time = CpuTime(child.pid()) - cpu_before;
  }
  const absl::Duration passed = absl::FromChrono(std::chrono::steady_clock::now() - start);
  EXPECT_LE(taken, cpu_time + absl::Milliseconds(1));
  EXPECT_GT(passed, 1.5 * cpu_time);
}

TEST(ProcessClock, SleepCountsAsTheTimeThatPasses) {
  const Child child([] { pause(); });
  ASSERT_GT(child.pid(), 0);
  ProcessClock clock(child.pid());
  // The child may be held up before it sleeps.
  while (clock.Look() == absl::ZeroDuration()) absl::SleepFor(absl::Milliseconds(5));
  const absl::Duration before = clock.Look();
  absl::SleepFor(absl::Milliseconds(200));
  EXPECT_GE(clock.Look() - before, absl::Milliseconds(190));
}

// A caller that waits for output which another process holds open must reach its limit.
TEST(ProcessClock, TimeGoesOnAfterTheEnd) {
  const Child child([] { _exit(0); });
  ASSERT_GT(child.pid(), 0);
  siginfo_t info;
  ASSERT_EQ(waitid(P_PID, static_cast<id_t>(child.pid()), &info, WEXITED | WNOWAIT), 0);
  ProcessClock clock(child.pid());
  absl::SleepFor(absl::Milliseconds(50));
  EXPECT_GE(clock.Look(), absl::Milliseconds(50));
}

}  // namespace
}  // namespace sightline
