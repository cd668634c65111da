// SPDX-License-Identifier: Apache-2.0
// The report on a camera from its flat-field and dark frames: one HTML file that needs nothing
// else, not even a network. Charts are drawn without a script, so that they print.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "sightline/v1/sensor_set.pb.h"

namespace sightline {

// The page as UTF-8 HTML; the same data give the same bytes. All texts are escaped; what the
// diagnosis does not hold has no section. INVALID_ARGUMENT names a curve whose lists differ in
// size.
absl::StatusOr<std::string> RenderSensorReport(const v1::SensorDiagnosis& diagnosis);

// The same into a file, which appears at once or not at all. Errors of RenderSensorReport, or that
// the file cannot be written.
absl::Status WriteSensorReport(const v1::SensorDiagnosis& diagnosis, const std::string& path);

}  // namespace sightline
