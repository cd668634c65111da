// SPDX-License-Identifier: Apache-2.0
// The report of a verification (thesis, chapter 5): recordings beside their simulation.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "sightline/v1/report.pb.h"
#include "sightline/v1/verification.pb.h"

namespace sightline {

// The same data give the same report. INVALID_ARGUMENT names a profile with fewer values than rows.
absl::StatusOr<v1::Report> VerificationReport(const v1::Verification& verification);

// The page and its data beside it (WriteReport). Errors of VerificationReport, or that a file
// cannot be written.
absl::Status WriteVerificationReport(const v1::Verification& verification, const std::string& path);

}  // namespace sightline
