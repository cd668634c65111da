// SPDX-License-Identifier: Apache-2.0
// The size from which on a nonlinear response matters.
#pragma once

namespace sightline {

// A response that deviates by less is as good as linear for the position of a laser line [1].
// Chosen.
inline constexpr double kMaterialResponse = 1e-3;

}  // namespace sightline
