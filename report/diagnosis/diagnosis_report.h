// SPDX-License-Identifier: Apache-2.0
// The report of a diagnosis.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "sightline/v1/diagnosis.pb.h"
#include "sightline/v1/report.pb.h"

namespace sightline {

// Parts that the diagnosis does not contain have no section; the same data give the same report.
// `set_folder` contains the images named in diagnosis.calibrated, shown beside the maps; without
// it, or for other formats than PNG, there are no images. INVALID_ARGUMENT names a field whose size
// does not agree with its neighbours, e.g. a profile with fewer values than rows.
absl::StatusOr<v1::Report> DiagnosisReport(const v1::Diagnosis& diagnosis,
                                           const std::string& set_folder);

// The page and its data beside it (WriteReport). Errors of DiagnosisReport, or that a file cannot
// be written.
absl::Status WriteDiagnosisReport(const v1::Diagnosis& diagnosis, const std::string& set_folder,
                                  const std::string& path);

}  // namespace sightline
