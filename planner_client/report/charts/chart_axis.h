// SPDX-License-Identifier: Apache-2.0
// Scales of charts.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace sightline {

struct ChartAxis {
  std::string title;
  bool logarithmic = false;
  bool whole_numbers = false;  // ticks at integers only
  // Unset: as the data need it.
  std::optional<double> low, high;
  // Increasing; empty: round numbers. For values that come in steps of their own, as f-numbers do.
  std::vector<double> ticks = {};
};

// From values to places on the drawing.
class ChartScale {
 public:
  // `values`: the data; those that are not finite, or not positive on a logarithmic axis, do not
  // count. `low_at`, `high_at`: places of the axis' ends on the drawing.
  ChartScale(const ChartAxis& axis, const std::vector<double>& values, double low_at,
             double high_at);

  double low() const { return low_; }
  double high() const { return high_; }
  // Values outside of the axis are drawn at its end.
  double At(double value) const;
  bool Shows(double value) const;

  // At most about `count`, at round numbers; of the axis' own ticks those that do not crowd it.
  std::vector<double> Ticks(int count) const;

 private:
  bool logarithmic_, whole_numbers_;
  double low_ = 0, high_ = 1;
  double low_at_, high_at_;
  std::vector<double> own_ticks_;
};

}  // namespace sightline
