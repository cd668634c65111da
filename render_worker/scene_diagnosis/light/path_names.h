// SPDX-License-Identifier: Apache-2.0
// Names of light paths that are not effects of the vocabulary (render_worker/effects): factors of
// the null model, and effects of parts only.
#pragma once

#include <string_view>

namespace sightline {

// Factors of the null model.
inline constexpr std::string_view kLaserFactor = "laser_factor";
inline constexpr std::string_view kDarkMeanElectrons = "dark_mean_electrons";
inline constexpr std::string_view kLampFactor = "lamp_factor";

// Light that does not occur with a plate, or that the renderer's effects do not model.
inline constexpr std::string_view kInterreflection = "illumination.interreflection";
inline constexpr std::string_view kLampInterreflection = "illumination.lamp_interreflection";
inline constexpr std::string_view kLaserStrayLight = "illumination.laser_stray_light";

// The smooth map of fit/smooth_map.h, which represents light of unknown origin.
inline constexpr std::string_view kUnknownLight = "unknown";

}  // namespace sightline
