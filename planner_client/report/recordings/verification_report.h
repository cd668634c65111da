// SPDX-License-Identifier: Apache-2.0
// The report of a verification (thesis, chapter 5): one HTML file that needs nothing else, not even
// a network. Charts are drawn without a script, so that they print.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "sightline/v1/verification.pb.h"

namespace sightline {

// The page as UTF-8 HTML; the same data give the same bytes. All texts are escaped; what the
// verification does not hold has no section. INVALID_ARGUMENT names a field whose size does not fit
// its neighbours, e.g. a profile with fewer values than rows.
absl::StatusOr<std::string> RenderVerificationReport(const v1::Verification& verification);

// The same into a file, which appears at once or not at all. Errors of RenderVerificationReport, or
// that the file cannot be written.
absl::Status WriteVerificationReport(const v1::Verification& verification, const std::string& path);

}  // namespace sightline
