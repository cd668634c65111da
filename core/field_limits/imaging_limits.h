// SPDX-License-Identifier: Apache-2.0
// Allowed ranges of lens, sensor and exposure values for all files that have them: inspections,
// device catalogues, sensor files, optics planning, and for the options of `sightline new`. Error
// messages print them.
#pragma once

#include "core/field_limits/field_checks.h"

namespace sightline {

// Columns and rows of an image.
inline constexpr Limits kImageSize{16, 16384, " px"};
inline constexpr Limits kFieldOfView{0, 170, " deg", true, true};
// The camera may come as near as 0.1 m to the plane it is focused on.
inline constexpr Limits kLensFocalLength{1e-3, 0.1, " m", false, true};
inline constexpr Limits kLensFNumber{0.5, 128, ""};
inline constexpr Limits kLensTransmission{0, 1, "", true};
// The range of each coefficient of Distortion (core/rig/rig.h).
inline constexpr Limits kLensDistortion{-10, 10, ""};
inline constexpr Limits kApertureBlades{3, 64, " (or 0: a circle)"};
inline constexpr Limits kPixelPitch{1e-7, 1e-3, " m"};
inline constexpr Limits kLaserWavelength{200e-9, 2000e-9, " m"};
inline constexpr Limits kExposureTime{0, 100, " s", true};

}  // namespace sightline
