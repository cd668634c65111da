// SPDX-License-Identifier: Apache-2.0
// Exposure times of rendered facets: as the light falls off, dark beside the mirror, the same for
// any number of threads.
#include "render_worker/detectability/detectability_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "core/physics/angle.h"
#include "core/rig/scan_geometry.h"
#include "render_worker/detectability/facet.h"
#include "render_worker/detectability/facet_exposures.h"

namespace sightline {
namespace {

// `materials`: JSON of the assignments.
Inspection FacetTestInspection(const std::string& materials, double power_w = 0.005) {
  const std::string json = absl::StrCat(
      R"({"name": "facet", "part": {"file": "facet.stl", "unit": "m"},
      "camera": {"sensor": {"sensor_type": "mono", "pixel_pitch_m": 5.3e-6,
        "sensor_columns_px": 1280, "sensor_rows_px": 1024, "bit_depth_bit": 12,
        "quantum_efficiency": {"mono": 0.53}, "gain_dn_per_electron": 0.4,
        "saturation_capacity_electrons": 9900, "dark_mean_electrons": 20,
        "dark_noise_electrons": 6}},
      "lens": {"focal_length_m": 0.016, "transmission": 0.9, "f_number": 8},
      "laser": {"distance_m": 0.5, "fan_angle_deg": 45, "divergence_rad": 1e-3,
        "beam_focus_distance_m": 0.5, "power_w": )",
      power_w, R"(},
      "measurement": {"camera_distance_m": {"fixed": 0.4}},
      "render": {"speckle": false},
      "materials": [)",
      materials, "]}");
  v1::Inspection message;
  const absl::Status status = ParseStrictJson(json, "inspection.json", &message);
  EXPECT_TRUE(status.ok()) << status;
  auto inspection = ParseInspection(message, "inspection.json", "");
  EXPECT_TRUE(inspection.ok()) << inspection.status();
  return *std::move(inspection);
}

v1::Material Matt(double albedo) {
  v1::Material material;
  material.set_name("matt");
  material.mutable_lambert()->set_diffuse_albedo(albedo);
  return material;
}

ExposureRange Exposures(const v1::Material& material, const FacetView& view,
                        double power_w = 0.005) {
  const Inspection inspection = FacetTestInspection(
      R"({"material": {"name": "a", "lambert": {"diffuse_albedo": 0.5}}})", power_w);
  auto scene = MakeFacetScene(inspection, material, 0.5, view.camera_distance_m, 8, {});
  EXPECT_TRUE(scene.ok()) << scene.status();
  RenderLimits limits;
  auto range = FacetExposures(**scene, {}, view, 0.9, 1, limits);
  EXPECT_TRUE(range.ok()) << range.status();
  return range.value_or(ExposureRange{});
}

FacetView View(double camera_deg, double laser_deg, double azimuth_deg) {
  return {0.4, camera_deg * kRadPerDeg, laser_deg * kRadPerDeg, azimuth_deg * kRadPerDeg};
}

TEST(Facet, StandsUnderTheAnglesAskedFor) {
  const Rig rig;
  for (const double camera_deg : {0.0, 20.0, 65.0, 80.0, 87.0}) {
    for (const double laser_deg : {0.0, 20.0, 45.0, 80.0, 87.0}) {
      for (const double azimuth_deg : {0.0, 50.0, 130.0, 180.0}) {
        const FacetView view = View(camera_deg, laser_deg, azimuth_deg);
        const ScanGeometry geometry = MakeScanGeometry(rig, MeasurementOf(view));
        const Eigen::Vector3d normal = geometry.part_rotation.col(2);
        const Eigen::Vector3d to_camera = geometry.camera.origin_m.normalized(),
                              to_laser = geometry.laser.origin_m.normalized();
        EXPECT_NEAR(normal.dot(to_camera), std::cos(view.camera_incidence_rad), 1e-9);
        EXPECT_NEAR(normal.dot(to_laser), std::cos(view.laser_incidence_rad), 1e-9);
        if (camera_deg == 0 || laser_deg == 0) continue;
        const Eigen::Vector3d a = (to_camera - normal.dot(to_camera) * normal).normalized(),
                              b = (to_laser - normal.dot(to_laser) * normal).normalized();
        EXPECT_NEAR(a.dot(b), std::cos(view.azimuth_rad), 1e-6)
            << camera_deg << " " << laser_deg << " " << azimuth_deg;
      }
    }
  }
}

TEST(FacetExposures, AreInverseToAlbedoAndPower) {
  const FacetView view = View(20, 30, 180);
  const ExposureRange bright = Exposures(Matt(0.8), view), dark = Exposures(Matt(0.1), view);
  ASSERT_TRUE(std::isfinite(dark.longest_s));
  // Known to 5 %.
  EXPECT_NEAR(dark.shortest_s / bright.shortest_s, 8, 0.08 * 8);
  EXPECT_NEAR(dark.longest_s / bright.longest_s, 8, 0.08 * 8);
  const ExposureRange strong = Exposures(Matt(0.1), view, 0.05);
  EXPECT_NEAR(dark.shortest_s / strong.shortest_s, 10, 0.08 * 10);
  EXPECT_GT(bright.longest_s, 5 * bright.shortest_s);
}

// Seen along the normal, a tilted laser lights a wider line more weakly: the light for each length
// of the line stays the same, and so does the exposure while the line is hardly wider than the
// image of a point.
TEST(FacetExposures, OfANarrowLineDoNotFollowTheLasersIncidence) {
  const double upright_s = Exposures(Matt(0.5), View(0, 0, 0)).shortest_s;
  for (const double laser_deg : {30.0, 45.0, 60.0}) {
    const double time_s = Exposures(Matt(0.5), View(0, laser_deg, 0)).shortest_s;
    EXPECT_NEAR(time_s / upright_s, 1, 0.12) << laser_deg;
  }
}

TEST(FacetExposures, OfAMirrorAreShortInItsDirectionAlone) {
  v1::Material mirror;
  mirror.set_name("mirror");
  mirror.mutable_lambert_ggx()->set_diffuse_albedo(0.005);
  mirror.mutable_lambert_ggx()->set_specular_f0(0.9);
  mirror.mutable_lambert_ggx()->set_ggx_alpha(0.1);
  const ExposureRange in = Exposures(mirror, View(30, 30, 180)),
                      beside = Exposures(mirror, View(30, 30, 60));
  EXPECT_LT(in.shortest_s, 0.02 * beside.shortest_s);
  EXPECT_LT(in.longest_s, beside.shortest_s);
}

// A small grid would do, but there is one grid alone.
TEST(DetectabilityTable, IsTheSameForAnyNumberOfThreads) {
  const Inspection inspection = FacetTestInspection(
      R"({"part_material": "paint", "material": {"name": "p", "lambert": {"diffuse_albedo": 0.8}}},
         {"material": {"name": "q", "lambert": {"diffuse_albedo": 0.8}}})");
  DetectabilityTask task;
  task.part_materials = {"", "paint"};
  task.f_number = 8;
  std::string bytes;
  for (const int threads : {2, 1}) {
    DetectabilityHooks hooks;
    hooks.limits.threads = threads;
    double last = 0;
    hooks.on_progress = [&](double fraction, const std::string&) {
      EXPECT_GE(fraction, last);
      last = fraction;
    };
    const auto table = MakeDetectabilityTable(inspection, {}, {}, task, hooks);
    ASSERT_TRUE(table.ok()) << table.status();
    EXPECT_DOUBLE_EQ(last, 1);
    ASSERT_EQ(table->materials_size(), 2);
    EXPECT_EQ(table->materials(1).part_material(), "paint");
    EXPECT_EQ(table->materials(0).camera_distances_m_size(), 1);
    if (bytes.empty()) {
      bytes = table->SerializeAsString();
      // The coverage server takes it.
      v1::Detectability message;
      *message.mutable_table() = *table;
      EXPECT_TRUE(ParseDetectability(message, "table").ok());
    } else {
      EXPECT_EQ(table->SerializeAsString(), bytes);
    }
  }
}

TEST(DetectabilityTable, StopsAndNamesWhatIsMissing) {
  const Inspection inspection = FacetTestInspection(
      R"({"part_material": "paint", "material": {"name": "p", "lambert": {"diffuse_albedo": 0.8}}})");
  DetectabilityTask task;
  task.part_materials = {"steel"};
  task.f_number = 8;
  const auto missing = MakeDetectabilityTable(inspection, {}, {}, task, {});
  EXPECT_TRUE(absl::StrContains(missing.status().message(), "\"steel\"")) << missing.status();
  task.part_materials = {"paint"};
  const std::atomic<bool> cancelled = true;
  DetectabilityHooks hooks;
  hooks.limits.cancelled = &cancelled;
  EXPECT_TRUE(absl::IsCancelled(MakeDetectabilityTable(inspection, {}, {}, task, hooks).status()));
}

}  // namespace
}  // namespace sightline
