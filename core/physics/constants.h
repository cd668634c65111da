// SPDX-License-Identifier: Apache-2.0
// Constants of nature. Exact by definition: SI Brochure, 9th edition (2019), section 2.2.
#pragma once

namespace sightline {

inline constexpr double kPlanck_j_s = 6.62607015e-34;
inline constexpr double kSpeedOfLight_m_per_s = 299792458;
inline constexpr double kBoltzmann_j_per_k = 1.380649e-23;

}  // namespace sightline
