// SPDX-License-Identifier: Apache-2.0
// Findings as inspections: of a part, and of the plate itself.
#include "planner_client/diagnosis_client/calibrated_part.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/part/load_part.h"
#include "planner_client/diagnosis_client/calibrated_inspection.h"
#include "planner_client/diagnosis_client/plate_inspection.h"
#include "tests/planner_client/diagnosis_client/found_diagnosis.h"

namespace sightline {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

v1::Inspection PartInspection() {
  v1::Inspection message;
  const absl::Status status =
      ParseStrictJson(absl::StrCat(R"({"name": "head", "part": {"file": "head.obj", "unit": "m"},
        "camera": {"sensor": )",
                                   kSensor, R"(},
        "lens": {"focal_length_m": 0.016, "f_number": 8}, "laser": {"power_w": 0.005},
        "lighting": {"area_lights": [{"centre_m": {"z": 1}, "half_edge_u_m": {"x": 0.1},
          "half_edge_v_m": {"y": -0.1}, "radiance_w_m2_sr": 10}]},
        "render": {"laser_interreflection": false, "max_bounces": 0},
        "materials": [{"material": {"name": "paint", "lambert": {"diffuse_albedo": 0.8}}}]})"),
                      "inspection", &message);
  EXPECT_TRUE(status.ok()) << status;
  return message;
}

// Calibrates with what a render worker states for light paths that are fitted to images of a part.
CalibratedInspection Calibrate(const v1::Inspection& inspection, v1::Diagnosis diagnosis) {
  RecordingSet set;
  set.part.emplace();
  for (const v1::Effect& effect : diagnosis.calibrated_effects()) {
    if (effect.parameters().contains("interreflected_light_factor")) {
      AddInterreflectionChanges(effect.effect(), /*laser_light=*/true,
                                effect.parameters().at("interreflected_light_factor"), &diagnosis);
    } else if (FindEffect(effect.effect()) == nullptr) {
      AddWithoutField(effect.effect(), &diagnosis);
    } else {
      StateChanges(effect, set, &diagnosis);
    }
  }
  return CalibratePartInspection(inspection, diagnosis);
}

TEST(CalibratedPart, NothingFoundChangesNothing) {
  const CalibratedInspection result = CalibratePartInspection(PartInspection(), {});
  EXPECT_EQ(result.inspection.SerializeAsString(), PartInspection().SerializeAsString());
  EXPECT_THAT(result.changes, IsEmpty());
  EXPECT_THAT(result.warnings, IsEmpty());
}

TEST(CalibratedPart, FactorsAndLightGoWhereTheyBelong) {
  v1::Diagnosis diagnosis;
  AddDeviation(&diagnosis, "laser_factor", 0.2);
  AddDeviation(&diagnosis, "dark_mean_electrons", -1.5);
  AddDeviation(&diagnosis, "lamp_factor", -0.1);
  AddEffect(&diagnosis, "illumination.interreflection", {{"interreflected_light_factor", 1.02}});
  AddEffect(&diagnosis, "illumination.ambient_light", {{"ambient_radiance_w_m2_sr", 0.4}});
  AddEffect(&diagnosis, "optics.veiling_glare",
            {{"glare_fraction", 0.05}, {"halo_radius_m", 2e-4}});
  AddEffect(&diagnosis, "sensor.black_level_error", {{"black_level_shift_electrons", 4}});
  const CalibratedInspection result = Calibrate(PartInspection(), diagnosis);
  EXPECT_THAT(result.warnings, IsEmpty());
  const auto parsed = ParseInspection(result.inspection, "calibrated", "");
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  EXPECT_DOUBLE_EQ(parsed->rig.laser.power_w, 0.006);
  EXPECT_DOUBLE_EQ(parsed->sensor->dark_mean_electrons, 30);
  EXPECT_DOUBLE_EQ(parsed->lighting.area_lights(0).radiance_w_m2_sr(), 9);
  EXPECT_DOUBLE_EQ(parsed->lighting.ambient().radiance_w_m2_sr(), 0.4);
  EXPECT_EQ(parsed->lighting.ambient().spectrum().illuminant(), "d65");
  EXPECT_TRUE(parsed->render.laser_interreflection);
  EXPECT_GT(parsed->render.max_bounces, 0);
  ASSERT_EQ(parsed->effects.size(), 1u);
  EXPECT_EQ(parsed->effects[0].id, "optics.veiling_glare");
}

TEST(CalibratedPart, WhatCannotBeSaidIsAWarning) {
  v1::Diagnosis diagnosis;
  AddEffect(&diagnosis, "illumination.interreflection", {{"interreflected_light_factor", 1.4}});
  AddEffect(&diagnosis, "illumination.laser_stray_light", {{"stray_fraction", 0.1}});
  AddEffect(&diagnosis, "illumination.ambient_light", {{"ambient_radiance_w_m2_sr", 0.4}});
  AddDeviation(&diagnosis, "dark_mean_electrons", -100);
  v1::Inspection inspection = PartInspection();
  inspection.mutable_lighting()->mutable_ambient()->set_radiance_w_m2_sr(1);
  const CalibratedInspection result = Calibrate(inspection, diagnosis);
  EXPECT_EQ(result.warnings.size(), 4u);
  EXPECT_THAT(result.warnings, Contains(HasSubstr("1.4 times the light")));
  EXPECT_THAT(result.warnings, Contains(HasSubstr("illumination.laser_stray_light")));
  EXPECT_THAT(result.warnings, Contains(HasSubstr("another spectrum")));
  EXPECT_THAT(result.warnings, Contains(HasSubstr("out of its range; it is 0")));
  EXPECT_TRUE(ParseInspection(result.inspection, "calibrated", "").ok());
}

TEST(CalibratedPart, EffectsWithoutChangesAreKeptWithAWarning) {
  v1::Diagnosis diagnosis;
  AddEffect(&diagnosis, "sensor.black_level_error", {{"black_level_shift_electrons", 4}});
  const CalibratedInspection result = CalibratePartInspection(PartInspection(), diagnosis);
  EXPECT_EQ(result.inspection.effects_size(), 1);
  EXPECT_EQ(result.warnings.size(), 1u);
}

TEST(PlateInspection, SaysWhatTheRecordingsSay) {
  v1::Recordings recordings;
  const absl::Status status = ParseStrictJson(
      absl::StrCat(R"({"format": "laser-line-recordings", "format_version": 1, "set": "s",
        "camera": )",
                   kSensor, R"(, "lens": {"focal_length_m": 0.016, "transmission": 0.9},
        "laser": {"wavelength_m": 650e-9, "power_w": 0.005, "divergence_rad": 1e-3,
          "beam_focus_distance_m": 0.9, "fan_angle_deg": 40},
        "surface": {"diffuse_albedo": 0.35, "specular_f0": 0.6, "ggx_alpha": 0.4},
        "rig": {"incidence_angle_deg": 35},
        "recordings": [{"file": "a.png", "kind": "dark", "exposure_time_s": 1},
          {"file": "b.png", "kind": "laser", "exposure_time_s": 0.02, "f_number": 5.6,
           "camera_distance_m": 0.3, "focus_distance_m": 0.31, "laser_distance_m": 0.4}]})"),
      "recordings", &recordings);
  ASSERT_TRUE(status.ok()) << status;
  const v1::Inspection message = InspectionOfPlate(recordings, "plate.obj");
  const auto inspection = ParseInspection(message, "plate", "");
  ASSERT_TRUE(inspection.ok()) << inspection.status();
  EXPECT_EQ(inspection->rig.lens->f_number, 5.6);
  EXPECT_EQ(inspection->rig.lens->focus_distance_m, 0.31);
  EXPECT_EQ(inspection->rig.laser.distance_m, 0.4);
  EXPECT_EQ(inspection->rig.laser.wavelength_m, 650e-9);
  EXPECT_EQ(inspection->render.exposure_time_s, 0.02);
  EXPECT_EQ(inspection->domain.parameters[0].values, std::vector<double>{0.3});
  EXPECT_TRUE(LoadPartFromMemory(kPlateObj, "obj", "m", "plate").ok());
  // It is the recorded plate to the calibration: everything goes where it belongs.
  v1::Diagnosis diagnosis;
  for (const char* name : {"f_number_relative", "power_relative", "diffuse_albedo_relative",
                           "gain_relative", "focus_distance_relative", "transmission_relative"}) {
    AddDeviation(&diagnosis, name, 0.02);
  }
  const CalibratedInspection result = CalibrateInspection(message, recordings, diagnosis);
  EXPECT_THAT(result.warnings, IsEmpty());
  EXPECT_EQ(result.changes.size(), 6u);
}

}  // namespace
}  // namespace sightline
