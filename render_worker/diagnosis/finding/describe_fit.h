// SPDX-License-Identifier: Apache-2.0
// Describes in the answer how well a fitted model describes and predicts a set.
#pragma once

#include <cstdint>

#include "render_worker/diagnosis/fit/fit.h"
#include "render_worker/diagnosis/fit/predictive_check.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

v1::ModelFit DescribeFit(const SetModel& model, const FitResult& fit);

// Improvement on held-out recordings, and on each kind of observable as if it were not fitted.
v1::HeldOutImprovement DescribeImprovement(const SetModel& model, const FitResult& null,
                                           const FitResult& best, uint64_t seed);

// `null`: the check of the model that its score is compared with.
v1::PredictiveCheck DescribeCheck(const PredictiveCheck& check, const PredictiveCheck& null);

}  // namespace sightline
