// SPDX-License-Identifier: Apache-2.0
// The report on a camera from its flat-field and dark frames.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "sightline/v1/report.pb.h"
#include "sightline/v1/sensor_set.pb.h"

namespace sightline {

// Parts that the diagnosis does not contain have no section. The same data give the same report.
// INVALID_ARGUMENT names a curve whose lists differ in size.
absl::StatusOr<v1::Report> SensorReport(const v1::SensorDiagnosis& diagnosis);

// The page and its data beside it (WriteReport). Errors of SensorReport, or that a file cannot be
// written.
absl::Status WriteSensorReport(const v1::SensorDiagnosis& diagnosis, const std::string& path);

}  // namespace sightline
