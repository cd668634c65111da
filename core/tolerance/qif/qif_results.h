// SPDX-License-Identifier: Apache-2.0
// Measured characteristics of a QIF 3.0 results file, such as a coordinate measuring program writes
// it for a plan: values come back to the plan's characteristics by their persistent ids.
//
//   const auto results = ReadQifResults("scanner.qif");
//   for (const MeasuredCharacteristic& measured : results->front().characteristics)
//     Note(measured.persistent_id, measured.value_m);
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace sightline {

struct MeasuredCharacteristic {
  // UUID of the characteristic item, as plan.qif has it; empty: the file gives none.
  std::string persistent_id;
  std::string item_id;     // in its file
  std::string name;        // of the item; may be empty
  std::string designator;  // of the item, such as the id of a tolerance; may be empty
  std::string status;      // "PASS", "FAIL", ... as the file states it
  // The value is a length [m] or an angle [rad]; unset: none is given, or it is a text.
  std::optional<double> value_m, value_rad;
  // Combined standard uncertainty of the value, in its unit; unset: none is given.
  std::optional<double> standard_uncertainty_m, standard_uncertainty_rad;
};

// One set of results of a file: usually one part.
struct QifMeasurementResults {
  std::string persistent_id;       // empty: none is given
  std::string plan_persistent_id;  // UUID of the plan that was carried out; empty: none is given
  std::vector<MeasuredCharacteristic> characteristics;
};

// `schema_folder` and `length_unit` as for ReadQif. Elements that are not needed are read past.
// Errors as ReadQifXml and QifUnits, and INVALID_ARGUMENT with file, line and element for a file
// without results, a measurement without a characteristic item that is in the file, and a value or
// an uncertainty that is no number or negative.
absl::StatusOr<std::vector<QifMeasurementResults>> ReadQifResults(
    const std::string& file, const std::string& schema_folder = "",
    const std::string& length_unit = "");

}  // namespace sightline
