// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/process/interrupt.h"

#include <csignal>

namespace sightline {
namespace {

std::atomic<bool> interrupted{false};

void OnSignal(int signal) {
  interrupted.store(true);
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
