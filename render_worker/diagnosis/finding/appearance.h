// SPDX-License-Identifier: Apache-2.0
// The appearance of unknown physics in words.
#pragma once

#include <string>

#include "render_worker/diagnosis/selection/compare_models.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// For an answer with model-discrepancy terms: what each of them does, with the coefficients that
// differ from 0 by two standard errors (the three that do so most), the law that the residual
// follows in the set-up (`diagnosis.laws`), and how far the nearest known effects are behind. Empty
// for other answers. At least one hypothesis must be ranked.
std::string AppearanceText(const ModelComparison& comparison, const v1::Diagnosis& diagnosis);

}  // namespace sightline
