// SPDX-License-Identifier: Apache-2.0
// Prior of the radiance of other light.
#pragma once

namespace sightline {

// EffectParameter::decades: the range from a closed housing with a laser filter to a lit hall
// without either.
inline constexpr double kRadianceDecades = 6;

}  // namespace sightline
