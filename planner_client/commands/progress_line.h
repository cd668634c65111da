// One line of progress on stderr: redrawn in place on a terminal, now and then elsewhere.
#pragma once

#include <chrono>
#include <string>

namespace sightline {

class ProgressLine {
 public:
  ProgressLine();
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  // `fraction` in [0, 1].
  void Show(double fraction, const std::string& text);
  // Leaves the last state on the screen and starts a new line.
  void Finish();

 private:
  bool terminal_;
  bool drawn_ = false;
  std::string last_phase_;
  std::chrono::steady_clock::time_point last_{};
};

}  // namespace sightline
