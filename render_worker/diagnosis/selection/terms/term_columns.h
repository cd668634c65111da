// SPDX-License-Identifier: Apache-2.0
// Functions of a stage's coordinates in which a discrepancy at that stage is expanded: the
// coefficients of its model-discrepancy terms.
#pragma once

#include <cstddef>
#include <vector>

#include "render_worker/diagnosis/selection/context.h"

namespace sightline {

inline constexpr Stage kStages[] = {Stage::kIllumination, Stage::kSurface, Stage::kOptics,
                                    Stage::kGeometry,     Stage::kSensor,  Stage::kTime};

// One coefficient of a term.
struct TermColumn {
  const Effect* term = nullptr;
  size_t coefficient = 0;
  // Expectation with this coefficient at kTermProbe prior scales [units of the statistics].
  BlockVectors mean;
};

// Columns of all terms of `stage` without a random law, in addition to the effects of `about`.
// Columns that are not finite everywhere are left out.
std::vector<TermColumn> TermColumnsOf(const Context& context, const SetParameters& about,
                                      Stage stage);

// The terms of the columns, each once, in the order in which they act.
std::vector<const Effect*> TermsOf(const std::vector<TermColumn>& columns);

}  // namespace sightline
