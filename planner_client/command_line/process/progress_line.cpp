// SPDX-License-Identifier: Apache-2.0
#include "planner_client/command_line/process/progress_line.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "absl/strings/str_format.h"
#include "core/text/printable.h"
#include "planner_client/command_line/help/terminal.h"

namespace sightline {
namespace {

constexpr int kBarWidth = 20;
constexpr auto kRedraw = std::chrono::milliseconds(100);
constexpr auto kLogInterval = std::chrono::seconds(5);
constexpr auto kJsonInterval = std::chrono::milliseconds(200);

bool json_progress = false;

}  // namespace

void UseJsonProgress() { json_progress = true; }
bool UsesJsonProgress() { return json_progress; }

std::string TimeText(double fraction, absl::Duration elapsed) {
  constexpr double kLeastFraction = 0.05;
  const auto text = [](absl::Duration duration) {
    // FormatDuration writes 0 without a unit.
    const absl::Duration whole = absl::Trunc(duration, absl::Seconds(1));
    return whole == absl::ZeroDuration() ? std::string("0s") : absl::FormatDuration(whole);
  };
  if (elapsed < absl::Seconds(2)) return "";
  const std::string so_far = text(elapsed) + " so far";
  if (fraction < kLeastFraction || elapsed < absl::Seconds(10)) return so_far;
  return so_far + ", about " + text(elapsed * ((1 - fraction) / fraction)) + " left";
}

ProgressLine::ProgressLine(ProgressPhase phase)
    : phase_(phase), terminal_(!json_progress && isatty(STDERR_FILENO) != 0) {}

ProgressLine::~ProgressLine() { Finish(); }

void ProgressLine::Show(double fraction, const std::string& text) {
  const auto now = std::chrono::steady_clock::now();
  const std::chrono::milliseconds interval = json_progress ? kJsonInterval
                                             : terminal_   ? kRedraw
                                                         : std::chrono::milliseconds(kLogInterval);
  if (now - last_ < interval) return;
  last_ = now;
  fraction = std::clamp(fraction, 0.0, 1.0);
  if (json_progress) {
    const nlohmann::json line = {
        {"progress", phase_.begin + fraction * (phase_.end - phase_.begin)}, {"message", text}};
    std::fprintf(stderr, "%s\n",
                 line.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
    return;
  }
  const std::string time = TimeText(fraction, absl::FromChrono(now - phase_start_));
  const std::string told = Printable(time.empty() ? text : absl::StrFormat("%s (%s)", text, time));
  if (terminal_) {
    const int filled = static_cast<int>(std::lround(fraction * kBarWidth));
    const std::string bar = std::string(filled, '#') + std::string(kBarWidth - filled, '.');
    std::string line = absl::StrFormat("[%s] %3.0f %%  %s", bar, 100 * fraction, told);
    // A wrapped line could not be redrawn; some terminals wrap after the last column.
    const size_t columns = TerminalColumns(STDERR_FILENO, 80) - 1;
    if (line.size() > columns) line = line.substr(0, columns - 3) + "...";
    std::fprintf(stderr, "\r\033[K%s", line.c_str());
    std::fflush(stderr);
    drawn_ = true;
  } else {
    std::fprintf(stderr, "%3.0f %%  %s\n", 100 * fraction, told.c_str());
  }
}

void ProgressLine::Finish() {
  if (drawn_) std::fputc('\n', stderr);
  drawn_ = false;
  last_ = {};
}

}  // namespace sightline
