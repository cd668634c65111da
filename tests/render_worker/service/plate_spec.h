// SPDX-License-Identifier: Apache-2.0
// A small plate for tests of the services.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "sightline/v1/render_service.pb.h"

namespace sightline {

inline constexpr char kPlateSpecSensor[] = R"("sensor_type": "mono", "pixel_pitch_m": 5.3e-6,
  "sensor_columns_px": 64, "sensor_rows_px": 48, "bit_depth_bit": 10,
  "quantum_efficiency": {"mono": 0.53}, "gain_dn_per_electron": 0.16,
  "saturation_capacity_electrons": 9893, "dark_mean_electrons": 27.57, "dark_noise_electrons": 6.5,
  "dark_current_electrons_per_s": 0)";

// `count` recordings of a small plate at f/16, the last one dark.
inline v1::RenderSpec PlateSpec(int count = 2) {
  std::string recordings;
  for (int i = 0; i < count; ++i) {
    const bool dark = i == count - 1;
    absl::StrAppend(&recordings, i > 0 ? "," : "", R"({"file": "images/)", i, R"(.png", "kind": ")",
                    dark ? "dark" : "laser", R"(", "timestamp_s": )", i, ", ",
                    dark ? "" : absl::StrCat(R"("plate_position_id": )", i, ", "),
                    R"("same_speckle": false, "burst_frame_index": 0, "exposure_time_s": 0.002,
        "f_number": 16, "camera_distance_m": 0.331, "focus_distance_m": 0.331,
        "laser_distance_m": 0.416, "line_offset_m": 0, "roi_column_px": -32, "roi_row_px": -24,
        "roi_columns_px": 64, "roi_rows_px": 48, "repeat_group": )",
                    i, "}");
  }
  v1::RenderSpec spec;
  const absl::Status status = ParseStrictJson(
      absl::StrCat(R"({"plate": {"recordings": {"format": "laser-line-recordings",
        "format_version": 1, "set": "test", "camera": {)",
                   kPlateSpecSensor, R"(}, "lens": {"focal_length_m": 0.016, "transmission": 0.92},
        "laser": {"wavelength_m": 6.61e-7, "power_w": 0.00058, "divergence_rad": 0.00105,
          "beam_focus_distance_m": 0.44, "fan_angle_deg": 36.8},
        "surface": {"diffuse_albedo": 0.35, "specular_f0": 0.66, "ggx_alpha": 0.43},
        "rig": {"incidence_angle_deg": 45}, "recordings": [)",
                   recordings, "]}}}"),
      "spec", &spec);
  EXPECT_TRUE(status.ok()) << status;
  return spec;
}

}  // namespace sightline
