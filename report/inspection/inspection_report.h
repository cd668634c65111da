// SPDX-License-Identifier: Apache-2.0
// The report of a measured part: verdicts, the surface coloured by deviation, measured data.
#pragma once

#include "absl/status/statusor.h"
#include "report/inspection/deviation_views.h"
#include "sightline/v1/measured_result.pb.h"
#include "sightline/v1/report.pb.h"

namespace sightline {

// The report as data. INTERNAL: a picture cannot be encoded.
absl::StatusOr<v1::Report> InspectionReport(const v1::InspectionResult& result,
                                            const SurfaceDeviations& surface);

}  // namespace sightline
