// SPDX-License-Identifier: Apache-2.0
// Progress on stderr: one line redrawn in place on a terminal, a line now and then elsewhere, lines
// of JSON for programs that asked for them.
#pragma once

#include <chrono>
#include <string>

namespace sightline {

// Of all progress and errors of this process: text for people, or a JSON object a line:
// {"progress":0.42,"message":"..."}, {"error":{"code":"...","reason":"...","message":"..."}}.
void UseJsonProgress();
bool UsesJsonProgress();

// What part of the whole command a phase is, in [0, 1]: programs are told of the whole.
struct ProgressPhase {
  double begin = 0;
  double end = 1;
};

class ProgressLine {
 public:
  explicit ProgressLine(ProgressPhase phase = {});
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  // What follows belongs to another phase.
  void Enter(ProgressPhase phase) { phase_ = phase; }
  // `fraction` of the phase, in [0, 1].
  void Show(double fraction, const std::string& text);
  // Leaves the last state on the screen and starts a new line.
  void Finish();

 private:
  ProgressPhase phase_;
  bool terminal_;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point last_{};
};

}  // namespace sightline
