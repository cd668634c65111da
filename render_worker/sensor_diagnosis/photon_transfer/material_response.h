// SPDX-License-Identifier: Apache-2.0
// Size above which a nonlinear response is material.
#pragma once

namespace sightline {

// A smaller deviation of the response does not affect the position of a laser line [1].
// Chosen.
inline constexpr double kMaterialResponse = 1e-3;

}  // namespace sightline
