// SPDX-License-Identifier: Apache-2.0
// Progress on stderr: one line redrawn in place on a terminal, occasional lines otherwise, or JSON
// lines for programs that request them. People also see the elapsed time of the phase and, after a
// twentieth of it, the remaining time at the same rate.
#pragma once

#include <chrono>
#include <string>

#include "absl/time/time.h"

namespace sightline {

// Selects JSON for all progress and errors of this process, one object a line:
// {"progress":0.42,"message":"..."}, {"error":{"code":"...","reason":"...","message":"..."}}.
void UseJsonProgress();
bool UsesJsonProgress();

// The interval in [0, 1] of the whole command that a phase fills; JSON reports use the whole.
struct ProgressPhase {
  double begin = 0;
  double end = 1;
};

// "2m10s so far, about 5m left" for a phase that is done to `fraction` after `elapsed`. The
// estimate is omitted before a twentieth of the phase and ten seconds; the text is empty during the
// first two seconds.
std::string TimeText(double fraction, absl::Duration elapsed);

class ProgressLine {
 public:
  explicit ProgressLine(ProgressPhase phase = {});
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  // Assigns later reports to another phase.
  void Enter(ProgressPhase phase) {
    phase_ = phase;
    phase_start_ = std::chrono::steady_clock::now();
  }
  // Shows `fraction` of the phase, in [0, 1].
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
