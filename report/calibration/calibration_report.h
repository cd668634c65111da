// SPDX-License-Identifier: Apache-2.0
// The report of a calibration: predicted against real errors, by frame and along the line.
#pragma once

#include "report/calibration/calibration_result.h"
#include "sightline/v1/report.pb.h"

namespace sightline {

// The same result gives the same report.
v1::Report CalibrationReport(const CalibrationResult& result);

}  // namespace sightline
