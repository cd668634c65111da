// SPDX-License-Identifier: Apache-2.0
// Compares recordings with their simulation as in chapter 5 of the thesis; nothing is fitted.
#pragma once

#include <cstdint>

#include "absl/status/statusor.h"
#include "render_worker/diagnosis/diagnose.h"
#include "render_worker/recordings/recorded_set.h"
#include "sightline/v1/verification.pb.h"

namespace sightline {

struct VerificationSettings {
  uint64_t seed = 1;  // of the simulated speckle and noise
  int threads = 2;
};

// Simulates every laser recording of `set` from its nominal description with the full image chain.
// Compares for each colour channel, on its own pixels: mean profiles across the line, relative
// intensity error e_i (thesis eq. 5.7), standard deviation of the detected line along the line u_px
// and u_h (eq. 5.9), and their relative error e_u (eq. 5.10). If no line is detected, the fields
// are unset and a warning is added. The same set and seed give the same bytes for any number of
// threads. FAILED_PRECONDITION: no laser recordings or no images; CANCELLED.
absl::StatusOr<v1::Verification> Verify(const RecordedSet& set,
                                        const VerificationSettings& settings,
                                        const DiagnosisProgress& progress);

}  // namespace sightline
