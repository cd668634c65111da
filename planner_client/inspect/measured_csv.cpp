// SPDX-License-Identifier: Apache-2.0
#include "planner_client/inspect/measured_csv.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace sightline {
namespace {

std::string CsvText(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"') quoted += '"';
    quoted += c;
  }
  return quoted + "\"";
}

std::string CsvLength(bool set, double length_m) {
  return set ? absl::StrFormat("%.6g", 1e3 * length_m) : "";
}

}  // namespace

std::string MeasuredCsv(const v1::InspectionResult& result) {
  std::string csv =
      "id,name,kind,value_mm,expanded_uncertainty_mm,zone_width_mm,lower_limit_mm,upper_limit_mm,"
      "decision,because\r\n";
  for (const v1::InspectedFeature& f : result.features()) {
    absl::StrAppend(&csv, CsvText(f.id()), ",", CsvText(f.name()), ",", CsvText(f.kind()), ",",
                    CsvLength(f.has_value_m(), f.value_m()), ",",
                    CsvLength(f.has_expanded_uncertainty_m(), f.expanded_uncertainty_m()), ",",
                    CsvLength(f.has_zone_width_m(), f.zone_width_m()), ",",
                    CsvLength(f.has_lower_limit_m(), f.lower_limit_m()), ",",
                    CsvLength(f.has_upper_limit_m(), f.upper_limit_m()), ",",
                    v1::InspectedFeature::Decision_Name(f.decision()), ",", CsvText(f.because()),
                    "\r\n");
  }
  return csv;
}

}  // namespace sightline
