// SPDX-License-Identifier: Apache-2.0
// Readable numbers: rounded, with a unit of suitable size. Unicode text, not escaped.
#pragma once

#include <optional>
#include <string>

namespace sightline {

// "0.0123", "1.2·10⁻⁷": `significant` digits, a true minus sign; "–" if not a number.
std::string Number(double value, int significant = 3);

// "−0.3": `decimals` digits after the point.
std::string FixedNumber(double value, int decimals);

// Number without zeros at the end, for the ticks of charts: "0.2".
std::string ShortNumber(double value);

// "97.3 %"; values next to 0 and 1 give "< 0.1 %" and "> 99.9 %".
std::string ProbabilityText(double probability);

// "p = 0.43", "p < 10⁻⁶".
std::string PValueText(double p_value);

// "glare_fraction" -> "glare fraction"; "camera_distance_m" -> "camera distance": the value shows
// the unit.
std::string QuantityName(const std::string& name);

// Name of an effect as a title: "stage.its_name" -> "Its name".
std::string EffectTitle(const std::string& id);

// Value of a quantity whose name ends in its unit (recordings format): "0.21 mm", "4.8 %", "12 e⁻".
std::string QuantityText(const std::string& name, double value, int significant = 3);

// QuantityText for set values, as opposed to measured ones: no trailing zeros. "5.1 ms", "366 mm".
std::string SettingText(const std::string& name, double value);

// "0.210 ± 0.014 mm", rounded to two digits of the standard error (GUM 7.2.6). Without an error,
// or with one of 0: the value alone.
std::string QuantityWithError(const std::string& name, double value,
                              std::optional<double> standard_error);

// Best unit for values up to `magnitude` of a quantity, and its factor: how many of it make one of
// the unit in the name. 1000 and "mm" for "halo_radius_m"; "" without a unit.
struct ShownUnit {
  double per_named = 1;
  std::string name;
};
ShownUnit ShownUnitOf(const std::string& name, double magnitude);

// "0.18 … 0.24 mm".
std::string QuantityInterval(const std::string& name, double lower, double upper);

}  // namespace sightline
