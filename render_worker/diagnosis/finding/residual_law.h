// SPDX-License-Identifier: Apache-2.0
// Dependence of the null model's residual on the set-up (regression).
#pragma once

#include <cstdint>

#include "render_worker/diagnosis/fit/fit.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// Adds the quantities of the set-up on which the null model's residual depends. The residual is its
// amplitude in every recording [DN] at the rows in which the two models differ.
void AddLaws(const SetModel& model, const FitResult& null, const FitResult& best, uint64_t seed,
             v1::Diagnosis* diagnosis);

}  // namespace sightline
