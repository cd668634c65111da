// SPDX-License-Identifier: Apache-2.0
// What the null model's residual grows with.
#pragma once

#include <cstdint>

#include "render_worker/diagnosis/fit/fit.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// What remains of the null model's residual in every recording [DN], where the two models differ,
// and the set-up's quantities it grows with.
void AddLaws(const SetModel& model, const FitResult& null, const FitResult& best, uint64_t seed,
             v1::Diagnosis* diagnosis);

}  // namespace sightline
