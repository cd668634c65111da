// SPDX-License-Identifier: Apache-2.0
// Verdicts as a table for spreadsheets.
#pragma once

#include <string>

#include "sightline/v1/measured_result.pb.h"

namespace sightline {

// A header, then a line for each feature: id, name, kind, value_mm, U_mm, zone_width_mm, lower and
// upper limit [mm], decision, because. Texts are quoted where RFC 4180 asks for it; unset numbers
// are empty.
std::string MeasuredCsv(const v1::InspectionResult& result);

}  // namespace sightline
