// SPDX-License-Identifier: Apache-2.0
// Text of single numbers in a diagnosis's report.
#pragma once

#include <optional>
#include <string>

#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// Names of the vocabulary as words, joined by commas: "line_flanks" -> "line flanks".
std::string NameWords(const google::protobuf::RepeatedPtrField<std::string>& names);

// Chi squared per degree of freedom; nothing without degrees of freedom.
std::optional<double> PerDegree(double chi_squared, int degrees_of_freedom);
std::string PerDegreeText(double chi_squared, int degrees_of_freedom);

// "before -> after".
std::string Change(const std::string& before, const std::string& after);

// A gain in log evidence.
std::string GainText(double nats);

// "proportional to exposure_time_s^1 f_number^-2 (0.1 at exposure_time_s 0.02)" with whole
// exponents raised and values with their units.
std::string LawText(const std::string& law);

// The effects of an explanation by their titles.
std::string ExplanationTitle(const v1::Explanation& explanation);

}  // namespace sightline
