// SPDX-License-Identifier: Apache-2.0
// The report of a diagnosis: one HTML file that needs nothing else, not even a network. Charts are
// drawn without a script, so that they print.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// The page as UTF-8 HTML; the same data give the same bytes. All texts are escaped; what the
// diagnosis does not hold has no section. `set_folder` holds the images named in
// diagnosis.calibrated, shown beside the maps; empty, or not PNG: no images. INVALID_ARGUMENT names
// a field whose size does not fit its neighbours, e.g. a profile with fewer values than rows.
absl::StatusOr<std::string> RenderDiagnosisReport(const v1::Diagnosis& diagnosis,
                                                  const std::string& set_folder);

// The same into a file, which appears at once or not at all. Errors of RenderDiagnosisReport, or
// that the file cannot be written.
absl::Status WriteDiagnosisReport(const v1::Diagnosis& diagnosis, const std::string& set_folder,
                                  const std::string& path);

}  // namespace sightline
