// SPDX-License-Identifier: Apache-2.0
#include "planner_client/command_line/process/interrupt.h"

#include <unistd.h>

#include <csignal>
#include <string_view>

namespace sightline {
namespace {

std::atomic<bool> interrupted{false};

void OnSignal(int signal) {
  // A signal handler may call write, not stdio.
  constexpr std::string_view kMessage =
      "\ninterrupted: ending at the next step; once more ends at once\n";
  if (!interrupted.exchange(true)) {
    [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, kMessage.data(), kMessage.size());
  }
  std::signal(signal, SIG_DFL);
}

}  // namespace

const std::atomic<bool>& InterruptFlag() {
  static const bool installed = [] {
    std::signal(SIGINT, OnSignal);
    std::signal(SIGTERM, OnSignal);
    return true;
  }();
  (void)installed;
  return interrupted;
}

}  // namespace sightline
