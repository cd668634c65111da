// SPDX-License-Identifier: Apache-2.0
// Describes hypotheses in the answer.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "render_worker/diagnosis/selection/compare_models.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// Effect `index` of a hypothesis with its parameters and their 95 % intervals.
v1::FittedEffect DescribeEffect(const SetModel& model, const Hypothesis& hypothesis, size_t index);

// An effect with known parameters.
v1::FittedEffect DescribeEffect(const ActiveEffect& active);

// Covariance of the coefficients of effect `index` of a hypothesis, a model-discrepancy term, in
// their units. Coefficients that the hypothesis does not need count as known.
Eigen::MatrixXd CoefficientCovariance(const Hypothesis& hypothesis, size_t index);

// Adds `ranked`, `same_class` and `remainder`. Explanations with the same leading effect form one
// entry, with the parameters of the most probable one.
void AddExplanations(const SetModel& model, const ModelComparison& comparison, uint64_t seed,
                     v1::Diagnosis* diagnosis);

// Adds the state of an interrupted model comparison: hypotheses by their evidence so far, then
// the most promising effects that were screened but not fitted. `ranked` contains no
// predictions.
void AddUnfinished(const SetModel& model, const ModelComparison& comparison,
                   v1::Diagnosis* diagnosis);

// Adds the evidence of the best effect or model-discrepancy term of every stage of the chain.
void AddStages(const ModelComparison& comparison, v1::Diagnosis* diagnosis);

// Adds the strengths at which effects would have been detected.
void AddPower(const ModelComparison& comparison, v1::Diagnosis* diagnosis);

}  // namespace sightline
