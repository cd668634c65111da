// SPDX-License-Identifier: Apache-2.0
// Finds the physics that the nominal description of a set of recordings lacks (docs/diagnosis.md).
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/recordings/recorded_set.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

struct DiagnosisSettings {
  uint64_t seed = 1;
  int threads = 2;
  int max_effects = 2;                        // effects of one hypothesis, 1 to 3
  std::vector<std::string> excluded_effects;  // ids not to consider
};

// Gets the fraction done and the current step; returns false to cancel.
using DiagnosisProgress = std::function<bool(double, std::string_view)>;

// The same set and seed give the same answer for any number of threads. If cancelled while
// explanations are compared, returns the results so far with the verdict "interrupted"; if
// cancelled earlier, CANCELLED. FAILED_PRECONDITION: the recordings are too few; the message names
// what is missing. INVALID_ARGUMENT: an unknown effect is excluded.
absl::StatusOr<v1::Diagnosis> Diagnose(const RecordedSet& set, const DiagnosisSettings& settings,
                                       const DiagnosisProgress& progress);

}  // namespace sightline
