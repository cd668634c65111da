// SPDX-License-Identifier: Apache-2.0
// Two plates of different height under a laser line, with room light: small enough to be imaged
// often.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <numbers>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "core/part/load_part.h"
#include "render_worker/render/part_frame.h"
#include "render_worker/render/part_scene.h"

namespace sightline {

// The line, along y, crosses the step between z = 0 (y < 0) and the height (y > 0).
inline std::string StepObj(double height_m) {
  return absl::StrCat("v -0.03 -0.03 0\nv 0.03 -0.03 0\nv 0.03 0 0\nv -0.03 0 0\n", "v -0.03 0 ",
                      height_m, "\nv 0.03 0 ", height_m, "\nv 0.03 0.03 ", height_m,
                      "\nv -0.03 0.03 ", height_m, "\n",
                      "usemtl lower\nf 1 2 3\nf 1 3 4\nusemtl upper\nf 5 6 7\nf 5 7 8\n");
}

struct StepOptions {
  std::string lens = R"("f_number": 4)";  // further fields of the lens
  double ambient_w_m2_sr = 0.05;
  bool speckle = true;
  double albedo = 0.5, upper_albedo = 0.5;  // of the lower and the upper plate
  double height_m = 0.004;
  std::string more;  // further fields of the inspection
};

inline std::unique_ptr<PartScene> StepScene(const StepOptions& options = {}) {
  const std::string json = absl::StrCat(
      R"({"name": "step", "part": {"file": "step.obj", "unit": "m"},
      "camera": {"sensor": {"sensor_type": "mono", "pixel_pitch_m": 5.3e-6,
        "sensor_columns_px": 192, "sensor_rows_px": 96, "bit_depth_bit": 12,
        "quantum_efficiency": {"mono": 0.53}, "gain_dn_per_electron": 0.4,
        "saturation_capacity_electrons": 9900, "dark_mean_electrons": 20,
        "dark_noise_electrons": 6, "dark_current_electrons_per_s": 0}},
      "lens": {"focal_length_m": 0.016, "transmission": 0.9, )",
      options.lens, R"(},
      "laser": {"power_w": 0.005, "fan_angle_deg": 20, "divergence_rad": 1e-3,
        "beam_focus_distance_m": 0.3},
      "lighting": {"ambient": {"radiance_w_m2_sr": )",
      options.ambient_w_m2_sr, R"(}},
      "render": {"exposure_time_s": 0.0005, "speckle": )",
      options.speckle ? "true" : "false", R"(},
      "materials": [
        {"part_material": "lower", "material": {"name": "a", "lambert": {"diffuse_albedo": )",
      options.albedo, R"(}}},
        {"part_material": "upper", "material": {"name": "b", "lambert": {"diffuse_albedo": )",
      options.upper_albedo, "}}}]", options.more, "}");
  v1::Inspection message;
  const absl::Status status = ParseStrictJson(json, "inspection.json", &message);
  EXPECT_TRUE(status.ok()) << status;
  auto inspection = ParseInspection(message, "inspection.json", "");
  EXPECT_TRUE(inspection.ok()) << inspection.status();
  PartSceneInput input;
  input.inspection = *inspection;
  input.part = *LoadPartFromMemory(StepObj(options.height_m), "obj", "m", "step");
  auto scene = PartScene::Make(std::move(input));
  EXPECT_TRUE(scene.ok()) << scene.status();
  return *std::move(scene);
}

// From above, the laser at 30 degrees beside the camera.
inline PartFrameRequest StepFrame(double stage_position_m = 0) {
  Measurement measurement;
  measurement.camera_distance_m = 0.3;
  measurement.triangulation_angle_rad = std::numbers::pi / 6;
  return {measurement, stage_position_m};
}

inline RenderLimits TwoThreads() {
  RenderLimits limits;
  limits.threads = 2;
  return limits;
}

}  // namespace sightline
