// SPDX-License-Identifier: Apache-2.0
// Pi in single precision: materials compute with float.
#pragma once

#include <numbers>

namespace sightline {

inline constexpr float kPi = std::numbers::pi_v<float>;
inline constexpr float kInversePi = std::numbers::inv_pi_v<float>;

}  // namespace sightline
