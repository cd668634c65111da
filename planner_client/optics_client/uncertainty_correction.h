// SPDX-License-Identifier: Apache-2.0
// Expected uncertainty of the real camera, from a verification of the simulation (thesis
// eq. 6.7, 6.8).
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "sightline/v1/optics.pb.h"
#include "sightline/v1/verification.pb.h"

namespace sightline {

// Mean and standard deviation of e_u by f-number, over the recordings in which `channel` has one;
// "" or a channel that the verification does not have: over all channels. f-numbers with a single
// recording get the standard deviation pooled over the others. INVALID_ARGUMENT: no recording has
// e_u, or it is not below 1 (recorded minus simulated over recorded cannot be). `source` is kept
// for the report.
absl::StatusOr<v1::UncertaintyCorrection> MakeCorrection(const v1::Verification& verification,
                                                         const std::string& channel,
                                                         const std::string& source);

// u_real = u_sim / (1 - e_u) (eq. 6.8) with e_u at the f-number, linear in log N between those
// verified; its interval from the simulation's and from e_u -+ 2 standard deviations
// (thesis 6.4.3). Sets expected_real_u_px of all points of the plan. f-numbers outside those
// verified get none, and a warning says which; so do those whose e_u + 2 standard deviations is not
// below 1.
void ApplyCorrection(const v1::UncertaintyCorrection& correction, v1::OpticsPlan* plan);

}  // namespace sightline
