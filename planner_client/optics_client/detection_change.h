// SPDX-License-Identifier: Apache-2.0
// Difference between the detection learned from images and the one that scans were planned for. It
// decides when alternating planning of geometry and optics has converged.
#pragma once

#include "absl/status/statusor.h"
#include "core/uncertainty/uncertainty_model.h"
#include "sightline/v1/optics.pb.h"

namespace sightline {

// The table as planning uses it. INVALID_ARGUMENT as ParseUncertainty.
absl::StatusOr<LineDetectionNoise> NoiseOf(const v1::LearnedDetection& learned);

// Statistics of d_i = ln(u learned / u planned for) over the entries of the learned table.
struct DetectionChange {
  double root_mean_square = 0;
  // Root mean square of d_i over the standard error of the learned u, combined with the error of
  // the earlier table if that was learned too (as large at every entry as its mean square).
  double in_standard_errors = 0;

  // True if the change is within chance (two standard errors), or too small to move a scan: 1 % of
  // u, and thus of what a target needs.
  bool IsNone() const { return in_standard_errors <= 2 || root_mean_square <= 0.01; }
};
// `earlier_error`: mean relative standard error of `planned_for`; 0: it was stated, not learned.
DetectionChange ChangeOf(const LineDetectionNoise& planned_for, double earlier_error,
                         const v1::LearnedDetection& learned);

// Root mean square of the table's relative standard errors.
double MeanError(const v1::LearnedDetection& learned);

}  // namespace sightline
