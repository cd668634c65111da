// SPDX-License-Identifier: Apache-2.0
// A V-shaped groove of matt material under a laser line: light goes from one flank to the other.
#pragma once

#include <gtest/gtest.h>

#include <numbers>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "core/part/load_part.h"
#include "render_worker/render/part_frame.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"

namespace sightline {

// 90 degrees between the flanks, 12 mm deep; the line runs along y across both.
inline constexpr char kGrooveObj[] =
    "v -0.02 -0.012 0.012\nv 0.02 -0.012 0.012\nv -0.02 0 0\nv 0.02 0 0\n"
    "v -0.02 0.012 0.012\nv 0.02 0.012 0.012\nf 1 3 4\nf 1 4 2\nf 3 5 6\nf 3 6 4\n";

// Nominal description: no interreflection. `more`: further fields of the inspection.
inline std::string GrooveInspectionJson(const std::string& more = "") {
  return absl::StrCat(R"({"part": {"file": "groove.obj", "unit": "m"},
        "camera": {"sensor": {"sensor_type": "mono", "pixel_pitch_m": 5.3e-6,
          "sensor_columns_px": 128, "sensor_rows_px": 96, "bit_depth_bit": 12,
          "quantum_efficiency": {"mono": 0.53}, "gain_dn_per_electron": 0.4,
          "saturation_capacity_electrons": 9900, "dark_mean_electrons": 20,
          "dark_noise_electrons": 6, "dark_current_electrons_per_s": 0}},
        "lens": {"focal_length_m": 0.016, "f_number": 8, "transmission": 0.9},
        "laser": {"power_w": 0.005, "fan_angle_deg": 20, "divergence_rad": 1e-3,
          "beam_focus_distance_m": 0.3},
        "render": {"laser_interreflection": false, "exposure_time_s": 0.0005},
        "materials": [{"material": {"name": "paint", "lambert": {"diffuse_albedo": 0.8}}}])",
                      more, "}");
}

inline RecordedScene GrooveScene(const std::string& more = "") {
  v1::Inspection message;
  const absl::Status status =
      ParseStrictJson(GrooveInspectionJson(more), "inspection.json", &message);
  EXPECT_TRUE(status.ok()) << status;
  RecordedScene scene;
  auto inspection = ParseInspection(message, "inspection.json", "");
  EXPECT_TRUE(inspection.ok()) << inspection.status();
  scene.inspection = *inspection;
  scene.part = *LoadPartFromMemory(kGrooveObj, "obj", "m", "groove");
  scene.recordings.format_version = 2;
  scene.recordings.name = "groove";
  for (int i = 0; i < 2; ++i) {
    RecordedImage image;
    image.file = absl::StrCat("images/00", i, ".png");
    image.exposure_time_s = scene.inspection.render.exposure_time_s;
    image.f_number = scene.inspection.rig.lens->f_number;
    image.measurement.camera_distance_m = 0.3;
    image.measurement.triangulation_angle_rad = std::numbers::pi / 6;
    image.stage_position_m = 0.001 * i;
    scene.recordings.recordings.push_back(image);
  }
  return scene;
}

// Images of the scene as `truth` describes it, with speckle and noise.
inline void Record(RecordedScene* scene, const Inspection& truth,
                   const std::vector<ActiveEffect>& effects, int64_t seed) {
  PartSceneInput input;
  input.inspection = truth;
  input.inspection.render.seed = seed;
  input.part = scene->part;
  auto part = PartScene::Make(std::move(input));
  ASSERT_TRUE(part.ok()) << part.status();
  scene->raw_dn.clear();
  for (const RecordedImage& image : scene->recordings.recordings) {
    RenderLimits limits;
    limits.threads = 2;
    auto frame = RenderPartFrame(**part, {image.measurement, image.stage_position_m}, effects,
                                 /*layers=*/false, limits);
    ASSERT_TRUE(frame.ok()) << frame.status();
    scene->raw_dn.push_back(frame->image.raw_dn);
  }
}

}  // namespace sightline
