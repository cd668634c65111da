// SPDX-License-Identifier: Apache-2.0
// Waits of tests for what another thread or process does. A slow machine is no error, so these
// waits have no deadline of their own. A test that hangs is ended by its time limit in CTest
// (TIMEOUT), and a line on stderr says where it waited.
#pragma once

#include <chrono>
#include <cstdio>
#include <source_location>
#include <thread>

namespace sightline {

// Deadline of calls that a test expects to succeed: later than the time limit of any test.
inline std::chrono::system_clock::time_point FarDeadline() {
  return std::chrono::system_clock::now() + std::chrono::hours(24);
}

// Waits until `condition` holds.
template <typename Condition>
void WaitUntil(const Condition& condition,
               const std::source_location& place = std::source_location::current()) {
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::seconds kNoticeAfter{20};
  const Clock::time_point start = Clock::now();
  bool noticed = false;
  while (!condition()) {
    if (!noticed && Clock::now() - start > kNoticeAfter) {
      noticed = true;
      std::fprintf(stderr, "%s:%u: still waiting after %d s\n", place.file_name(), place.line(),
                   static_cast<int>(kNoticeAfter.count()));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

}  // namespace sightline
