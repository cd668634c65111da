// SPDX-License-Identifier: Apache-2.0
// Names of departures in the answer.
#pragma once

#include <string>
#include <string_view>

namespace sightline {

// Departures that are effects of the renderer's vocabulary (render_worker/effects) have its ids.
struct VocabularyNames {
  std::string stray_light, quadratic_response, brighter_fatter;
  std::string dark_column_pattern, hot_pixels, row_noise;
  std::string missing_codes, odd_even_width;
};
const VocabularyNames& NamesInVocabulary();

// The names below belong to departures that are not effects of the vocabulary.

// Photon transfer. The cubic response has the name of the quadratic one with this suffix.
inline constexpr std::string_view kCubicSuffix = "_cubic";
inline constexpr std::string_view kVarianceDeficit = "variance_deficit";
inline constexpr std::string_view kExposureTimeOffsetId = "time.exposure_time_offset";
inline constexpr std::string_view kReciprocityFailure = "reciprocity_failure";

// Fixed patterns. Patterns of columns and rows, "bright_row_pattern" and the like, have names of
// their illumination and direction.
inline constexpr std::string_view kDarkPattern = "dark_pattern";
inline constexpr std::string_view kBrightPattern = "bright_pattern";
inline constexpr std::string_view kDarkCellPattern = "dark_cell_pattern";
inline constexpr std::string_view kBrightCellPattern = "bright_cell_pattern";
inline constexpr std::string_view kDefectivePixels = "defective_pixels";
inline constexpr std::string_view kLightFallOff = "light_fall_off";

// Changes from frame to frame.
inline constexpr std::string_view kLightFlicker = "light_flicker";
inline constexpr std::string_view kLightDrift = "light_drift";
inline constexpr std::string_view kBlackLevelNoise = "black_level_noise";
inline constexpr std::string_view kBlackLevelDrift = "black_level_drift";
inline constexpr std::string_view kFrameCorrelation = "frame_correlation";
inline constexpr std::string_view kFirstFrameDeficit = "first_frame_deficit";
inline constexpr std::string_view kColumnNoise = "column_noise";
// With "_in_row" or "_in_column".
inline constexpr std::string_view kReadoutCorrelation = "readout_correlation";
inline constexpr std::string_view kInterpixelCoupling = "interpixel_coupling";

// Converter.
inline constexpr std::string_view kBlackLevelClipped = "black_level_clipped";

}  // namespace sightline
