// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/calibrated_inspection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "tests/planner_client/diagnosis_client/found_diagnosis.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

v1::Inspection MakeInspection() {
  v1::Inspection message;
  const absl::Status status =
      ParseStrictJson(absl::StrCat(R"({"name": "table", "part": {"file": "table.obj", "unit": "m"},
        "camera": {"sensor": )",
                                   kSensor, R"(},
        "lens": {"focal_length_m": 0.016, "f_number": 8, "focus_distance_m": 0.5},
        "laser": {"power_w": 0.005, "fan_angle_deg": 40},
        "materials": [
          {"part_material": "a", "material": {"name": "plate", "lambert_ggx":
            {"diffuse_albedo": 0.35, "specular_f0": 0.6, "ggx_alpha": 0.4}}},
          {"part_material": "b", "material": {"name": "grey",
            "lambert": {"diffuse_albedo": 0.5}}}]})"),
                      "inspection", &message);
  EXPECT_TRUE(status.ok()) << status;
  return message;
}

v1::Recordings Nominal() {
  v1::Recordings message;
  const absl::Status status = ParseStrictJson(
      absl::StrCat(R"({"format": "laser-line-recordings", "format_version": 1, "set": "s",
        "camera": )",
                   kSensor, R"(, "lens": {"focal_length_m": 0.016, "transmission": 0.9},
        "laser": {"wavelength_m": 661e-9, "power_w": 0.005, "divergence_rad": 0.24e-3,
          "beam_focus_distance_m": 0.9, "fan_angle_deg": 40},
        "surface": {"diffuse_albedo": 0.35, "specular_f0": 0.6, "ggx_alpha": 0.4},
        "rig": {"incidence_angle_deg": 45}})"),
      "recordings", &message);
  EXPECT_TRUE(status.ok()) << status;
  return message;
}

// Calibrates with what a render worker states for effects that are fitted to these recordings.
CalibratedInspection Calibrate(const v1::Inspection& inspection, const v1::Recordings& nominal,
                               v1::Diagnosis diagnosis) {
  RecordingSet set;
  set.surface = {nominal.surface().diffuse_albedo(), nominal.surface().specular_f0(),
                 nominal.surface().ggx_alpha()};
  set.laser.wavelength_m = nominal.laser().wavelength_m();
  for (const v1::Effect& effect : diagnosis.calibrated_effects()) {
    StateChanges(effect, set, &diagnosis);
  }
  return CalibrateInspection(inspection, nominal, diagnosis);
}

TEST(CalibratedInspection, NothingFoundChangesNothing) {
  const v1::Inspection before = MakeInspection();
  const CalibratedInspection after = Calibrate(before, Nominal(), {});
  EXPECT_EQ(after.inspection.SerializeAsString(), before.SerializeAsString());
  EXPECT_THAT(after.changes, IsEmpty());
  EXPECT_THAT(after.warnings, IsEmpty());
}

TEST(CalibratedInspection, DeviationsGoWhereTheyBelong) {
  v1::Diagnosis diagnosis;
  AddDeviation(&diagnosis, "f_number_relative", 0.02);
  AddDeviation(&diagnosis, "focus_distance_relative", -0.01);
  AddDeviation(&diagnosis, "transmission_relative", -0.03);
  AddDeviation(&diagnosis, "power_relative", 0.04);
  AddDeviation(&diagnosis, "divergence_relative", 0.05);
  AddDeviation(&diagnosis, "beam_focus_distance_m", -0.06);
  AddDeviation(&diagnosis, "diffuse_albedo_relative", 0.07);
  AddDeviation(&diagnosis, "specular_f0_relative", -0.08);
  AddDeviation(&diagnosis, "ggx_alpha_relative", -0.09);
  AddDeviation(&diagnosis, "quantum_efficiency_relative", 0.1);
  AddDeviation(&diagnosis, "gain_relative", 0.11);
  AddDeviation(&diagnosis, "dark_mean_electrons", 1.2);
  AddDeviation(&diagnosis, "dark_noise_relative", 0.13);
  AddDeviation(&diagnosis, "line_position_common_px", 0.7);
  const CalibratedInspection result = Calibrate(MakeInspection(), Nominal(), diagnosis);
  EXPECT_THAT(result.warnings, IsEmpty());
  EXPECT_EQ(result.changes.size(), 13u);
  const v1::Inspection& i = result.inspection;
  EXPECT_DOUBLE_EQ(i.lens().f_number(), 8 * 1.02);
  EXPECT_DOUBLE_EQ(i.lens().focus_distance_m(), 0.5 * 0.99);
  EXPECT_DOUBLE_EQ(i.lens().transmission(), 0.97);  // of the default, 1
  EXPECT_DOUBLE_EQ(i.laser().power_w(), 0.005 * 1.04);
  EXPECT_DOUBLE_EQ(i.laser().divergence_rad(), 0.24e-3 * 1.05);
  EXPECT_DOUBLE_EQ(i.laser().beam_focus_distance_m(), 0.9 - 0.06);
  const v1::Material::LambertGgx& surface = i.materials(0).material().lambert_ggx();
  EXPECT_DOUBLE_EQ(surface.diffuse_albedo(), 0.35 * 1.07);
  EXPECT_DOUBLE_EQ(surface.specular_f0(), 0.6 * 0.92);
  EXPECT_DOUBLE_EQ(surface.ggx_alpha(), 0.4 * 0.91);
  EXPECT_DOUBLE_EQ(i.materials(1).material().lambert().diffuse_albedo(), 0.5);
  EXPECT_DOUBLE_EQ(i.camera().sensor().quantum_efficiency().mono(), 0.5 * 1.1);
  EXPECT_DOUBLE_EQ(i.camera().sensor().gain_dn_per_electron(), 0.16 * 1.11);
  EXPECT_DOUBLE_EQ(i.camera().sensor().dark_mean_electrons(), 27.5 + 1.2);
  EXPECT_DOUBLE_EQ(i.camera().sensor().dark_noise_electrons(), 6.5 * 1.13);
  EXPECT_TRUE(ParseInspection(i, "calibrated", "").ok());
}

TEST(CalibratedInspection, ReflectsNoMoreThanItReceives) {
  v1::Diagnosis diagnosis;
  AddDeviation(&diagnosis, "specular_f0_relative", 0.2);
  const CalibratedInspection result = Calibrate(MakeInspection(), Nominal(), diagnosis);
  const v1::Inspection& i = result.inspection;
  EXPECT_TRUE(ParseInspection(i, "calibrated", "").ok());
  // The light that comes back is the same.
  const v1::Material::LambertGgx& surface = i.materials(0).material().lambert_ggx();
  EXPECT_NEAR(i.laser().power_w() * surface.diffuse_albedo(), 0.005 * 0.35, 1e-12);
  EXPECT_NEAR(i.laser().power_w() * surface.specular_f0(), 0.005 * 0.6 * 1.2, 1e-12);
}

TEST(CalibratedInspection, WhatCannotBeSaidIsAWarning) {
  v1::Diagnosis diagnosis;
  AddDeviation(&diagnosis, "camera_distance_m", 0.003);
  AddDeviation(&diagnosis, "focus_distance_relative", 0.01);
  AddDeviation(&diagnosis, "transmission_relative", 0.2);
  AddEffect(&diagnosis, "illumination.line_bow", {{"bow_m", 1e-4}});
  AddEffect(&diagnosis, "geometry.laser_distance_error", {{"laser_distance_shift_m", 0.01}});
  v1::Inspection inspection = MakeInspection();
  inspection.mutable_lens()->clear_focus_distance_m();
  const CalibratedInspection result = Calibrate(inspection, Nominal(), diagnosis);
  EXPECT_EQ(result.warnings.size(), 5u);
  EXPECT_THAT(result.warnings, Contains(HasSubstr("camera_distance_m: is of the set-up")));
  EXPECT_THAT(result.warnings, Contains(HasSubstr("lens.focus_distance_m is not given")));
  EXPECT_THAT(result.warnings, Contains(HasSubstr("out of its range; it is 1")));
  EXPECT_THAT(result.warnings, Contains(HasSubstr("illumination.line_bow")));
  EXPECT_EQ(result.inspection.effects_size(), 0);
  EXPECT_EQ(result.inspection.lens().transmission(), 1);
  EXPECT_TRUE(ParseInspection(result.inspection, "calibrated", "").ok());
}

TEST(CalibratedInspection, AnotherCameraLensOrLaserStaysAsItIs) {
  v1::Diagnosis diagnosis;
  AddDeviation(&diagnosis, "gain_relative", 0.1);
  AddDeviation(&diagnosis, "f_number_relative", 0.1);
  AddDeviation(&diagnosis, "power_relative", 0.1);
  AddDeviation(&diagnosis, "diffuse_albedo_relative", 0.1);
  AddEffect(&diagnosis, "sensor.prnu", {{"prnu_relative", 0.01}});
  v1::Recordings nominal = Nominal();
  nominal.mutable_camera()->set_sensor_rows_px(50);
  nominal.mutable_lens()->set_focal_length_m(0.025);
  nominal.mutable_laser()->set_wavelength_m(532e-9);
  nominal.mutable_surface()->set_diffuse_albedo(0.5);
  const v1::Inspection before = MakeInspection();
  const CalibratedInspection after = Calibrate(before, nominal, diagnosis);
  EXPECT_EQ(after.inspection.SerializeAsString(), before.SerializeAsString());
  EXPECT_EQ(after.warnings.size(), 5u);
}

TEST(CalibratedInspection, EffectsAreValuesWhereThereIsAFieldAndNamedElse) {
  v1::Diagnosis diagnosis;
  AddEffect(&diagnosis, "optics.f_number_error", {{"f_number_factor", 1.1}});
  AddEffect(&diagnosis, "illumination.beam_quality", {{"m2", 1.5}});
  AddEffect(&diagnosis, "sensor.dark_current", {{"dark_current_electrons_per_s", 40}});
  AddEffect(&diagnosis, "optics.veiling_glare",
            {{"glare_fraction", 0.05}, {"halo_radius_m", 2e-4}});
  const CalibratedInspection result = Calibrate(MakeInspection(), Nominal(), diagnosis);
  EXPECT_THAT(result.warnings, IsEmpty());
  EXPECT_DOUBLE_EQ(result.inspection.lens().f_number(), 8.8);
  EXPECT_DOUBLE_EQ(result.inspection.laser().beam_quality_m2(), 1.5);
  EXPECT_DOUBLE_EQ(result.inspection.camera().sensor().dark_current_electrons_per_s(), 40);
  ASSERT_EQ(result.inspection.effects_size(), 1);
  EXPECT_EQ(result.inspection.effects(0).effect(), "optics.veiling_glare");
  EXPECT_TRUE(ParseInspection(result.inspection, "calibrated", "").ok());
}

// A Lambert plate of albedo rho under the radiance L from everywhere has the radiance rho L.
TEST(CalibratedInspection, AmbientLightGivesThePlateItsRadiance) {
  v1::Diagnosis diagnosis;
  AddEffect(&diagnosis, "illumination.ambient_light", {{"ambient_radiance_w_m2_sr", 0.07}});
  v1::Recordings nominal = Nominal();
  // No lobe: F0 = 0 leaves Schlick's term alone, (1 - cos(theta/2))^5 < 0.0022.
  nominal.mutable_surface()->set_specular_f0(0);
  v1::Inspection inspection = MakeInspection();
  CalibratedInspection result = Calibrate(inspection, nominal, diagnosis);
  const v1::Lighting::Ambient& ambient = result.inspection.lighting().ambient();
  EXPECT_NEAR(ambient.radiance_w_m2_sr(), 0.07 / 0.35, 0.01 * 0.2);
  EXPECT_LE(ambient.radiance_w_m2_sr(), 0.07 / 0.35);
  EXPECT_EQ(ambient.spectrum().line().wavelength_m(), 661e-9);
  EXPECT_TRUE(ParseInspection(result.inspection, "calibrated", "").ok());

  // A smooth mirror of F0 = 1 without diffuse part reflects all of it: lobe of alpha -> 0.
  nominal.mutable_surface()->set_diffuse_albedo(0);
  nominal.mutable_surface()->set_specular_f0(1);
  nominal.mutable_surface()->set_ggx_alpha(0.05);
  result = Calibrate(inspection, nominal, diagnosis);
  // Light lost to shadowing is of the order alpha^2.
  EXPECT_NEAR(result.inspection.lighting().ambient().radiance_w_m2_sr(), 0.07, 0.07 * 0.01);

  // Light of another colour is not added to.
  inspection.mutable_lighting()->mutable_ambient()->set_radiance_w_m2_sr(1);
  inspection.mutable_lighting()->mutable_ambient()->mutable_spectrum()->set_illuminant("d65");
  result = Calibrate(inspection, nominal, diagnosis);
  EXPECT_EQ(result.inspection.lighting().ambient().radiance_w_m2_sr(), 1);
  EXPECT_THAT(result.warnings, Contains(HasSubstr("lighting.ambient")));
}

// An older worker sends effects without stating how an inspection expresses them.
TEST(CalibratedInspection, EffectsWithoutChangesAreKeptWithAWarning) {
  v1::Diagnosis diagnosis;
  AddEffect(&diagnosis, "illumination.power_error", {{"amplitude_factor", 1.1}});
  const CalibratedInspection result = CalibrateInspection(MakeInspection(), Nominal(), diagnosis);
  EXPECT_EQ(result.inspection.laser().power_w(), 0.005);
  ASSERT_EQ(result.inspection.effects_size(), 1);
  EXPECT_EQ(result.inspection.effects(0).effect(), "illumination.power_error");
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_THAT(result.warnings[0], HasSubstr("illumination.power_error"));
}

// A newer worker may know fields and operations that this program does not.
TEST(CalibratedInspection, EffectsWithUnknownChangesAreKeptWithAWarning) {
  for (const bool unknown_field : {true, false}) {
    v1::Diagnosis diagnosis;
    AddEffect(&diagnosis, "illumination.power_error", {{"amplitude_factor", 1.1}});
    v1::InspectionChange* change = diagnosis.add_inspection_changes();
    change->set_source("illumination.power_error");
    change->set_field(unknown_field ? "laser.colour" : "laser.power_w");
    change->set_value(1.1);
    if (unknown_field) change->set_operation(v1::InspectionChange::OPERATION_FACTOR);
    const CalibratedInspection result = CalibrateInspection(MakeInspection(), Nominal(), diagnosis);
    EXPECT_EQ(result.inspection.laser().power_w(), 0.005);
    EXPECT_EQ(result.inspection.effects_size(), 1);
    ASSERT_EQ(result.warnings.size(), 1u);
    EXPECT_THAT(result.warnings[0], HasSubstr(change->field()));
  }
}

TEST(CalibratedInspection, TransmissionAboveOneAndUnstatedFocusStayEffects) {
  v1::Diagnosis diagnosis;
  AddEffect(&diagnosis, "optics.transmission_error", {{"amplitude_factor", 1.2}});
  AddEffect(&diagnosis, "optics.focus_error", {{"focus_distance_factor", 1.05}});
  v1::Inspection inspection = MakeInspection();
  inspection.mutable_lens()->clear_focus_distance_m();
  CalibratedInspection result = Calibrate(inspection, Nominal(), diagnosis);
  EXPECT_THAT(result.warnings, IsEmpty());
  EXPECT_EQ(result.inspection.effects_size(), 2);
  EXPECT_FALSE(result.inspection.lens().has_transmission());
  inspection.mutable_lens()->set_focus_distance_m(0.4);
  inspection.mutable_lens()->set_transmission(0.5);
  result = Calibrate(inspection, Nominal(), diagnosis);
  EXPECT_EQ(result.inspection.effects_size(), 0);
  EXPECT_DOUBLE_EQ(result.inspection.lens().transmission(), 0.6);
  EXPECT_DOUBLE_EQ(result.inspection.lens().focus_distance_m(), 0.42);
}

TEST(CalibratedInspection, ColoursAreScaledWhereTheyAreStated) {
  v1::Recordings nominal = Nominal();
  nominal.mutable_camera()->set_sensor_type("bayer_rggb");
  v1::Inspection inspection = MakeInspection();
  v1::Sensor* sensor = inspection.mutable_camera()->mutable_sensor();
  sensor->set_sensor_type("bayer_rggb");
  sensor->clear_quantum_efficiency();
  for (const double wavelength_m : {500e-9, 600e-9}) {
    v1::Sensor::QuantumEfficiencyPoint* point = sensor->add_quantum_efficiency_curve();
    point->set_wavelength_m(wavelength_m);
    point->set_red(0.2);
    point->set_green(0.4);
    point->set_blue(0.3);
  }
  v1::Diagnosis diagnosis;
  AddEffect(&diagnosis, "sensor.colour_response_error",
            {{"qe_factor_green", 1.1}, {"qe_factor_blue", 0.9}});
  const CalibratedInspection result = Calibrate(inspection, nominal, diagnosis);
  EXPECT_THAT(result.warnings, IsEmpty());
  for (const v1::Sensor::QuantumEfficiencyPoint& point :
       result.inspection.camera().sensor().quantum_efficiency_curve()) {
    EXPECT_EQ(point.red(), 0.2);
    EXPECT_DOUBLE_EQ(point.green(), 0.44);
    EXPECT_DOUBLE_EQ(point.blue(), 0.27);
  }
  EXPECT_FALSE(result.inspection.camera().sensor().has_quantum_efficiency());
}

// In an inspection with the camera, the lens and the laser of the recordings, every effect of the
// vocabulary becomes a number, one of the inspection's effects, or a warning.
TEST(CalibratedInspection, NoEffectIsDropped) {
  for (const Effect* effect : AllEffects()) {
    const EffectDescription& description = effect->description();
    const std::string id(description.id);
    v1::Diagnosis diagnosis;
    std::vector<std::pair<std::string, double>> parameters;
    for (const EffectParameter& p : description.parameters) {
      const double above = p.null_value + p.prior_scale;
      parameters.emplace_back(p.name, above <= p.upper ? above : p.null_value - p.prior_scale);
    }
    AddEffect(&diagnosis, id, parameters);
    v1::Recordings nominal = Nominal();
    v1::Inspection inspection = MakeInspection();
    inspection.mutable_lens()->set_transmission(0.5);
    if (id == "sensor.colour_response_error") {  // a mono sensor does not have it
      for (v1::Sensor* sensor :
           {nominal.mutable_camera(), inspection.mutable_camera()->mutable_sensor()}) {
        sensor->set_sensor_type("bayer_rggb");
        sensor->mutable_quantum_efficiency()->set_green(0.5);
      }
    }
    const CalibratedInspection result = Calibrate(inspection, nominal, diagnosis);
    const bool kept = result.inspection.effects_size() == 1;
    const bool changed = result.inspection.SerializeAsString() != inspection.SerializeAsString();
    EXPECT_EQ(changed, !result.changes.empty()) << id;
    EXPECT_TRUE(changed || !result.warnings.empty()) << id;
    EXPECT_EQ(kept,
              description.inspection_fields.empty() && description.scope == EffectScope::kAnyImage)
        << id;
    for (const std::string& warning : result.warnings) {
      EXPECT_THAT(warning, testing::Not(HasSubstr("not known"))) << id;
    }
  }
}

TEST(CalibratedInspection, FileCanBeReadFromItsNewFolder) {
  std::string folder = "/tmp/sightline-calibrated-XXXXXX";
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  fs::create_directories(folder + "/parts");
  fs::create_directories(folder + "/set/calibrated");
  std::ofstream(folder + "/parts/table.obj")
      << "v -0.1 -0.1 0\nv 0.1 -0.1 0\nv 0.1 0.1 0\nv -0.1 0.1 0\nf 1 2 3\nf 1 3 4\n";
  std::ofstream(folder + "/sensor.json") << kSensor;
  v1::Inspection inspection = MakeInspection();
  inspection.mutable_part()->set_file("parts/table.obj");
  inspection.mutable_camera()->clear_sensor();
  inspection.mutable_camera()->set_sensor_file("sensor.json");
  std::ofstream(folder + "/inspection.json") << ToJson(inspection);
  v1::Diagnosis diagnosis;
  AddDeviation(&diagnosis, "gain_relative", 0.25);
  const auto result = CalibrateInspectionFile(folder + "/inspection.json", Nominal(), diagnosis,
                                              folder + "/set/calibrated");
  ASSERT_TRUE(result.ok()) << result.status();
  std::ofstream(folder + "/set/calibrated/inspection.json") << ToJson(result->inspection);
  const auto read = ReadInspection(folder + "/set/calibrated/inspection.json");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_TRUE(fs::exists(read->part_file)) << read->part_file;
  EXPECT_DOUBLE_EQ(read->sensor->gain_dn_per_electron, 0.2);
  fs::remove_all(folder);
}

}  // namespace
}  // namespace sightline
