// SPDX-License-Identifier: Apache-2.0
// How well a fitted model describes and predicts a set, in the words of the answer.
#pragma once

#include <cstdint>

#include "render_worker/diagnosis/fit/fit.h"
#include "render_worker/diagnosis/fit/predictive_check.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

v1::ModelFit DescribeFit(const SetModel& model, const FitResult& fit);

// On held-out recordings, and on every kind of observable as if it alone had not been fitted.
v1::HeldOutImprovement DescribeImprovement(const SetModel& model, const FitResult& null,
                                           const FitResult& best, uint64_t seed);

// `null`: what its score is compared with.
v1::PredictiveCheck DescribeCheck(const PredictiveCheck& check, const PredictiveCheck& null);

}  // namespace sightline
