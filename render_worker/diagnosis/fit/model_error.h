// SPDX-License-Identifier: Apache-2.0
// How accurate the model itself is, so that its errors are not taken for effects.
#pragma once

namespace sightline {

// Relative error of the modelled change that an effect causes. Chosen equal to the error that the
// model of speckle showed against rendered frames (statistic/noise/texture_statistic.cpp). Where a
// change is thousands of standard deviations, its error is many, and must not decide between
// explanations.
constexpr double kEffectError = 0.02;

// Factor on differences in evidence and on chi squared of predictions. The model's errors (in the
// distribution of speckle and in its correlations) are systematic and can look like an effect.
// Chosen; bench/concealed/check_statistics prints by how much chi squared exceeds its degrees of
// freedom.
constexpr double kEvidenceWeight = 0.8;

}  // namespace sightline
