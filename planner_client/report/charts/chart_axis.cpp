// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/charts/chart_axis.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sightline {

ChartScale::ChartScale(const ChartAxis& axis, const std::vector<double>& values, double low_at,
                       double high_at)
    : logarithmic_(axis.logarithmic),
      whole_numbers_(axis.whole_numbers),
      low_at_(low_at),
      high_at_(high_at),
      own_ticks_(axis.ticks) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double value : values) {
    if (!std::isfinite(value) || (logarithmic_ && value <= 0)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  if (!(low <= high)) {
    low = axis.low.value_or(logarithmic_ ? 0.1 : 0);
    high = axis.high.value_or(std::max(1.0, low + 1));
  }
  // Room for the marks at the ends.
  if (logarithmic_) {
    const double room = std::max(std::pow(high / low, 0.06), 1.12);
    low_ = axis.low.value_or(low / room);
    high_ = axis.high.value_or(high * room);
    low_ = std::max(low_, std::numeric_limits<double>::min());
    if (!(high_ > low_)) high_ = 10 * low_;
  } else {
    double room = 0.05 * (high - low);
    if (room == 0) room = low == 0 ? 1 : 0.1 * std::abs(low);
    low_ = axis.low.value_or(low - room);
    high_ = axis.high.value_or(high + room);
    if (!(high_ > low_)) high_ = low_ + std::max(1.0, 0.1 * std::abs(low_));
  }
}

double ChartScale::At(double value) const {
  const double cut = std::clamp(value, low_, high_);
  const double fraction =
      logarithmic_ ? (std::log(cut) - std::log(low_)) / (std::log(high_) - std::log(low_))
                   : (cut - low_) / (high_ - low_);
  return low_at_ + fraction * (high_at_ - low_at_);
}

bool ChartScale::Shows(double value) const {
  return std::isfinite(value) && value >= low_ && value <= high_;
}

std::vector<double> ChartScale::Ticks(int count) const {
  std::vector<double> ticks;
  if (!own_ticks_.empty()) {
    // They are not equally spaced: half the mean distance is still enough for a label.
    const double nearest = 0.5 * std::abs(high_at_ - low_at_) / std::max(count, 1);
    for (const double tick : own_ticks_) {
      if (!Shows(tick)) continue;
      if (ticks.empty() || std::abs(At(tick) - At(ticks.back())) >= nearest) ticks.push_back(tick);
    }
    return ticks;
  }
  if (logarithmic_) {
    const double decades = std::log10(high_ / low_);
    const int first = static_cast<int>(std::floor(std::log10(low_)));
    const int last = static_cast<int>(std::ceil(std::log10(high_)));
    const std::vector<std::vector<double>> choices = {
        {1, 2, 3, 4, 5, 6, 8}, {1, 2, 5}, {1, 3}, {1}};
    // The finest choice that does not crowd the axis.
    for (const std::vector<double>& choice : choices) {
      if (choice.size() > 1 && decades * static_cast<double>(choice.size()) > count) continue;
      const int step = std::max(1, static_cast<int>(std::ceil(decades / count)));
      for (int decade = first; decade <= last; decade += step) {
        for (const double digit : choice) {
          const double tick = digit * std::pow(10, decade);
          if (tick >= low_ * (1 - 1e-9) && tick <= high_ * (1 + 1e-9)) ticks.push_back(tick);
        }
      }
      return ticks;
    }
  }
  const double rough = (high_ - low_) / std::max(count, 1);
  const double power = std::pow(10, std::floor(std::log10(rough)));
  double step = 10 * power;
  for (const double digit : {1.0, 2.0, 5.0}) {
    if (digit * power >= rough) {
      step = digit * power;
      break;
    }
  }
  if (whole_numbers_) step = std::max(1.0, std::round(step));
  for (auto i = std::ceil(low_ / step - 1e-9); i * step <= high_ + 1e-9 * step; ++i) {
    ticks.push_back(i == 0 ? 0 : i * step);
  }
  return ticks;
}

}  // namespace sightline
