// SPDX-License-Identifier: Apache-2.0
#include "core/text/number_text.h"

#include <charconv>
#include <cmath>

namespace sightline {
namespace {

template <typename Number>
std::string ShortestText(Number value) {
  if (std::isnan(value)) return "NaN";
  if (std::isinf(value)) return value > 0 ? "Infinity" : "-Infinity";
  if (value == 0) return std::signbit(value) ? "-0.0" : "0";
  const double magnitude = std::abs(static_cast<double>(value));
  const auto format = magnitude >= 1e-5 && magnitude < 1e15 ? std::chars_format::fixed
                                                            : std::chars_format::scientific;
  char buffer[64];
  const auto end = std::to_chars(buffer, buffer + sizeof(buffer), value, format).ptr;
  return std::string(buffer, end);
}

}  // namespace

std::string NumberText(double value) { return ShortestText(value); }

std::string FloatText(float value) { return ShortestText(value); }

}  // namespace sightline
