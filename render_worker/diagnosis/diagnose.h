// SPDX-License-Identifier: Apache-2.0
// From a set of recordings to what its nominal description leaves out (docs/diagnosis.md).
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
  int max_effects = 2;                        // at once, 1 to 3
  std::vector<std::string> excluded_effects;  // ids not to consider
};

// Fraction done and what is being done; false cancels.
using DiagnosisProgress = std::function<bool(double, std::string_view)>;

// The same set and seed give the same answer, for any number of threads. Cancelled while
// explanations are compared: what is known until then, with the verdict "interrupted"; earlier:
// CANCELLED. FAILED_PRECONDITION: the recordings are too few to say anything, naming what is
// missing; INVALID_ARGUMENT: an unknown effect is excluded.
absl::StatusOr<v1::Diagnosis> Diagnose(const RecordedSet& set, const DiagnosisSettings& settings,
                                       const DiagnosisProgress& progress);

}  // namespace sightline
