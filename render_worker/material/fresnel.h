// SPDX-License-Identifier: Apache-2.0
// Reflectance of smooth surfaces.
#pragma once

namespace sightline {

// Schlick's approximation (1994), F0 + (1 - F0)(1 - cos)^5.
float SchlickFresnel(float f0, float cosine);

// Exact reflectance of unpolarised light by n + ik seen from air (Born and Wolf, 7th ed., section
// 14.2); k = 0: a dielectric.
float UnpolarisedFresnel(float n, float k, float cosine);

}  // namespace sightline
