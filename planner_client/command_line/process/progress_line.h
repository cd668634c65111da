// SPDX-License-Identifier: Apache-2.0
// Progress on stderr: one line redrawn in place on a terminal, a line now and then elsewhere, lines
// of JSON for programs that asked for them. People also see for how long the phase has been running
// and, once a twentieth of it is done, how long the rest takes at the same rate.
#pragma once

#include <chrono>
#include <string>

#include "absl/time/time.h"

namespace sightline {

// Format of all progress and errors of this process: text for people, or a JSON object a line:
// {"progress":0.42,"message":"..."}, {"error":{"code":"...","reason":"...","message":"..."}}.
void UseJsonProgress();
bool UsesJsonProgress();

// The interval of the whole command, in [0, 1], that a phase fills; programs see the whole.
struct ProgressPhase {
  double begin = 0;
  double end = 1;
};

// "2m10s so far, about 5m left" of a phase of which `fraction` is done after `elapsed`; no estimate
// of the rest before a twentieth of the phase and ten seconds have passed, and nothing in the first
// two seconds.
std::string TimeText(double fraction, absl::Duration elapsed);

class ProgressLine {
 public:
  explicit ProgressLine(ProgressPhase phase = {});
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  // Later reports belong to another phase.
  void Enter(ProgressPhase phase) {
    phase_ = phase;
    phase_start_ = std::chrono::steady_clock::now();
  }
  // `fraction` of the phase, in [0, 1].
  void Show(double fraction, const std::string& text);
  // Leaves the last state on the screen and starts a new line.
  void Finish();

 private:
  ProgressPhase phase_;
  bool terminal_;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point phase_start_ = std::chrono::steady_clock::now();
  std::chrono::steady_clock::time_point last_{};
};

}  // namespace sightline
