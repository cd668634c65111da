// SPDX-License-Identifier: Apache-2.0
// Checks fields of a message; errors name context (file), field, value and range.
#pragma once

#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/text/number_text.h"

namespace sightline {

inline double Radians(double degrees) { return degrees * std::numbers::pi / 180; }

// Rounded to 1e-9 degrees if that is still the same angle: 30 degrees come back as 30, not as
// 30.000000000000004, and a value at the end of its range stays inside it.
inline double Degrees(double radians) {
  const double degrees = radians * 180 / std::numbers::pi;
  const double rounded = std::round(degrees * 1e9) / 1e9;
  return Radians(rounded) == radians ? rounded : degrees;
}

// Allowed range of a number in the unit of its field.
struct Limits {
  double min, max;
  const char* unit;  // "" or with a leading space
  bool min_open = false, max_open = false;

  bool Contains(double value) const {
    // NaN fails every comparison.
    return (min_open ? value > min : value >= min) && (max_open ? value < max : value <= max);
  }
  // The same range in another unit; one unit of the field is `count` of the other unit. Rounded to
  // 1e-9, so that 0.1 um does not become 0.0999....
  Limits In(const char* other_unit, double count) const {
    const auto rounded = [count](double value) { return std::round(value * count * 1e9) / 1e9; };
    return {rounded(min), rounded(max), other_unit, min_open, max_open};
  }
  std::string ToString() const {
    return absl::StrCat(min_open ? "(" : "[", NumberText(min), ", ", NumberText(max),
                        max_open ? ")" : "]", unit);
  }
};

// Puts file and field into every message.
class Checker {
 public:
  explicit Checker(std::string context) : context_(std::move(context)) {}

  absl::Status Error(const std::string& path, const std::string& reason) const {
    return absl::InvalidArgumentError(
        absl::StrCat(context_.empty() ? "" : absl::StrCat(context_, ": "), path, " ", reason));
  }
  absl::Status Range(const std::string& path, double value, const Limits& limits) const {
    if (limits.Contains(value)) return absl::OkStatus();
    return Error(path, absl::StrCat("is ", NumberText(value), ", must be in ", limits.ToString()));
  }

 private:
  std::string context_;
};

}  // namespace sightline
