#include "planner_client/commands/progress_line.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace sightline {
namespace {

constexpr int kBarWidth = 30;
constexpr auto kRedraw = std::chrono::milliseconds(100);
constexpr auto kLogInterval = std::chrono::seconds(5);

}  // namespace

ProgressLine::ProgressLine() : terminal_(isatty(STDERR_FILENO) != 0) {}

ProgressLine::~ProgressLine() { Finish(); }

void ProgressLine::Show(double fraction, const std::string& text) {
  const auto now = std::chrono::steady_clock::now();
  if (now - last_ < (terminal_
                         ? std::chrono::duration_cast<std::chrono::milliseconds>(kRedraw)
                         : std::chrono::duration_cast<std::chrono::milliseconds>(kLogInterval))) {
    return;
  }
  last_ = now;
  fraction = std::clamp(fraction, 0.0, 1.0);
  if (terminal_) {
    const int filled = static_cast<int>(fraction * kBarWidth + 0.5);
    const std::string bar = std::string(filled, '#') + std::string(kBarWidth - filled, '.');
    std::fprintf(stderr, "\r\033[K[%s] %3.0f %%  %s", bar.c_str(), 100 * fraction, text.c_str());
    std::fflush(stderr);
    drawn_ = true;
  } else {
    std::fprintf(stderr, "%3.0f %%  %s\n", 100 * fraction, text.c_str());
  }
}

void ProgressLine::Finish() {
  if (drawn_) std::fputc('\n', stderr);
  drawn_ = false;
  last_ = {};
}

}  // namespace sightline
