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

struct VerifiedCorrection {
  v1::UncertaintyCorrection errors;
  std::vector<std::string> remarks;  // recordings that were left out, and why
};

// Mean and standard deviation of e_u by f-number, over the recordings in which `channel` has one.
// f-numbers with a single recording get the standard deviation pooled over the others; if no
// f-number has two recordings, it stays 0 and no interval follows from it. INVALID_ARGUMENT: no
// recording has e_u of `channel` ("mono", "red", "green" or "blue"); or e_u is not below 1
// (recorded minus simulated over recorded cannot be); or the verification is of a colour camera and
// a monochrome one at the same time. `source` is kept for the report.
absl::StatusOr<VerifiedCorrection> MakeCorrection(const v1::Verification& verification,
                                                  const std::string& channel,
                                                  const std::string& source);

// u_real = u_sim / (1 - e_u) (eq. 6.8) with e_u at the f-number, linear in log N between those
// verified. Sets expected_real_u_px of all points of the plan.
//
// Its interval combines the simulation's with the 95 % prediction interval of e_u in one more
// recording: mean -+ t s sqrt(1 + 1/n), where n recordings have the standard deviation s, and t is
// the 97.5 % quantile of Student's t distribution with the degrees of freedom of s (n - 1, or those
// of the pooled s for a single recording). Without degrees of freedom, or if 1 - e_u may be zero,
// the point has no interval and a warning says so. f-numbers outside those verified get neither.
void ApplyCorrection(const VerifiedCorrection& correction, v1::OpticsPlan* plan);

}  // namespace sightline
