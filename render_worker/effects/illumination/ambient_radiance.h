// SPDX-License-Identifier: Apache-2.0
// Prior of the radiance of other light.
#pragma once

namespace sightline {

// EffectParameter::decades: from what a closed housing lets through a laser's filter to a lit hall
// without either.
inline constexpr double kRadianceDecades = 6;

}  // namespace sightline
