// SPDX-License-Identifier: Apache-2.0
#include "render_worker/effects/plates_in_poses.h"

#include <algorithm>
#include <iterator>
#include <string_view>

namespace sightline {
namespace {

// Effects that plates in poses (format version 3) cannot show. Their recordings are segments whose
// columns are shifted and may be transposed, so that rows and columns of the sensor are lost, along
// which charge overflows. Shape and place of the line, distances and angles are those of the poses.
constexpr std::string_view kNotInPoses[] = {
    "geometry.camera_roll",
    "geometry.laser_roll",
    "illumination.line_bow",
    "sensor.blooming",
    "sensor.column_gain",
    "sensor.row_noise",
    "sensor.dsnu_column_pattern",
    "sensor.rolling_shutter",
    "sensor.smear",
    "surface.curved_plate",
    "surface.tilted_plate",
    "unknown.cell_gain",
    "unknown.column_trail",
    "unknown.keystone",
    "unknown.line_noise",
    "unknown.line_place",
    "unknown.readout_lag",
    "unknown.row_memory",
    "unknown.setup",
};

// Effects that poses cannot show if the light is not stated either. Unstated values have no error;
// a response curve needs known amounts of light, a dark signal exposure times.
constexpr std::string_view kNeedStatedLight[] = {
    "geometry.laser_distance_error",
    "illumination.beam_focus",
    "illumination.beam_quality",
    "illumination.power_drift",
    "illumination.power_error",
    "illumination.wavelength_error",
    "optics.f_number_error",
    "optics.focus_error",
    "optics.transmission_error",
    "sensor.adc_inl",
    "sensor.black_level_error",
    "sensor.colour_response_error",
    "sensor.dark_current",
    "sensor.gain_error",
    "sensor.lower_full_well",
    "sensor.qe_error",
    "sensor.read_noise_excess",
    "sensor.response_nonlinearity",
    "surface.albedo_error",
    "surface.brdf_error",
    "time.exposure_jitter",
    "time.exposure_offset",
    "time.temperature_drift",
    "unknown.aperture",
    "unknown.codes",
    "unknown.dark_course",
    "unknown.dark_signal",
    "unknown.exposure",
    "unknown.power_course",
    "unknown.response",
    "unknown.response_law",
};

template <size_t n>
bool Has(const std::string_view (&ids)[n], const EffectDescription& description) {
  return std::find(std::begin(ids), std::end(ids), description.id) != std::end(ids);
}

}  // namespace

bool PosesCanShow(const EffectDescription& description) { return !Has(kNotInPoses, description); }

bool UnknownLightCanShow(const EffectDescription& description) {
  return !Has(kNeedStatedLight, description);
}

}  // namespace sightline
