// SPDX-License-Identifier: Apache-2.0
// How well the model itself is known: what its errors may be taken for.
#pragma once

namespace sightline {

// The change an effect makes is modelled to about this part of it. Where it is thousands of
// standard deviations, that part is many, which explanations must not be told apart by.
constexpr double kEffectError = 0.02;

// The model's own errors (of the speckle's law, of its correlations) are no noise: they can look
// like an effect. Differences in evidence, and chi squared of predictions, count less by this
// factor.
constexpr double kEvidenceWeight = 0.8;

}  // namespace sightline
