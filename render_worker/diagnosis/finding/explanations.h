// SPDX-License-Identifier: Apache-2.0
// Candidates in the words of the answer.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "render_worker/diagnosis/selection/competition.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// Effect `index` of a candidate with its parameters and their 95 % intervals.
v1::FittedEffect DescribeEffect(const SetModel& model, const Candidate& candidate, size_t index);

// Covariance of the coefficients of a candidate's free-form term (its last effect), in their units;
// those that are not needed are known.
Eigen::MatrixXd CoefficientCovariance(const Candidate& candidate);

// Explanations with the same leading effect are one, as the most probable of them has it.
void AddExplanations(const SetModel& model, const Competition& competition, uint64_t seed,
                     v1::Diagnosis* diagnosis);

// Of a competition that was stopped: candidates by their evidence so far, and below them the most
// promising effects that were looked at but not fitted. `ranked` has no word on predictions.
void AddUnfinished(const SetModel& model, const Competition& competition, v1::Diagnosis* diagnosis);

// What a free term or effect at every stage of the chain absorbs.
void AddStages(const Competition& competition, v1::Diagnosis* diagnosis);

// Strengths at which effects would have been found.
void AddPower(const Competition& competition, v1::Diagnosis* diagnosis);

}  // namespace sightline
