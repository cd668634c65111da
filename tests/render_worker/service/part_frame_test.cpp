// SPDX-License-Identifier: Apache-2.0
// Images of a part against closed forms: where the line is, how bright ambient light is, what
// motion does.
#include "render_worker/render/part_frame.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "core/part/load_part.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

constexpr int kColumns = 96, kRows = 64;
constexpr int kAxisRow = kRows / 2;  // the pixel that lies on the optical axis

constexpr char kTable[] =
    "v -0.1 -0.1 0\nv 0.1 -0.1 0\nv 0.1 0.1 0\nv -0.1 0.1 0\nf 1 2 3\nf 1 3 4\n";

// A part in front of a camera of 96 x 64 px; obstacles are tables.
std::unique_ptr<PartScene> SceneOf(const char* part, const std::string& more) {
  v1::Inspection message;
  absl::Status status = ParseStrictJson(absl::StrCat(R"({"part": {"file": "table.obj", "unit": "m"},
        "camera": {"sensor": {"sensor_type": "mono", "pixel_pitch_m": 5.3e-6,
          "sensor_columns_px": 96, "sensor_rows_px": 64, "bit_depth_bit": 16,
          "quantum_efficiency": {"mono": 0.53}, "gain_dn_per_electron": 0.16,
          "saturation_capacity_electrons": 1e8, "dark_mean_electrons": 0,
          "dark_noise_electrons": 0, "dark_current_electrons_per_s": 0}},
        "lens": {"focal_length_m": 0.016, "f_number": 11, "transmission": 0.9},
        "laser": {"power_w": 0.005, "fan_angle_deg": 40, "divergence_rad": 1.5e-3,
          "beam_focus_distance_m": 0.3},
        "materials": [{"material": {"lambert": {"diffuse_albedo": 0.5}}}])",
                                                     more, "}"),
                                        "inspection.json", &message);
  EXPECT_TRUE(status.ok()) << status;
  PartSceneInput input;
  const auto inspection = ParseInspection(message, "inspection.json", "");
  EXPECT_TRUE(inspection.ok()) << inspection.status();
  input.inspection = *inspection;
  input.part = *LoadPartFromMemory(part, "obj", "m", "part");
  for (size_t i = 0; i < input.inspection.obstacles.size(); ++i) {
    input.obstacles.push_back(*LoadPartFromMemory(kTable, "obj", "m", "table"));
  }
  auto scene = PartScene::Make(std::move(input));
  EXPECT_TRUE(scene.ok()) << scene.status();
  return *std::move(scene);
}

// A table of 0.2 x 0.2 m, its upper side at z = 0.
std::unique_ptr<PartScene> TableScene(const std::string& more) { return SceneOf(kTable, more); }

// Seen from above, laser at -30 degrees, the table raised by `height_m`.
Measurement FromAbove(double height_m) {
  Measurement measurement;
  measurement.camera_distance_m = 0.3;
  measurement.triangulation_angle_rad = std::numbers::pi / 6;
  measurement.offset_z_m = height_m;
  return measurement;
}

RenderedPartFrame Render(PartScene& scene, const Measurement& measurement) {
  RenderLimits limits;
  limits.threads = 2;
  auto frame = RenderPartFrame(scene, {measurement, 0}, {}, /*layers=*/false, limits);
  EXPECT_TRUE(frame.ok()) << frame.status();
  return *std::move(frame);
}

// Mean over the columns.
std::vector<double> Profile(const Image<double>& image) {
  std::vector<double> profile;
  for (int row = 0; row < image.rows_px; ++row) {
    double sum = 0;
    for (int column = 0; column < image.columns_px; ++column) sum += image.At(row, column);
    profile.push_back(sum / image.columns_px);
  }
  return profile;
}

// Centre of gravity within eight rows of the peak: the far wings are cut on one side sooner.
double LineRow(const Image<double>& image) {
  const std::vector<double> profile = Profile(image);
  const auto peak =
      static_cast<int>(std::max_element(profile.begin(), profile.end()) - profile.begin());
  double sum = 0, moment = 0;
  for (int row = std::max(0, peak - 8); row <= std::min(kRows - 1, peak + 8); ++row) {
    sum += profile[row];
    moment += row * profile[row];
  }
  return moment / sum;
}

TEST(PartFrame, LineIsWhereSheetAndSurfaceMeet) {
  const auto scene =
      TableScene(R"(, "render": {"laser_interreflection": false, "speckle": false})");
  for (const double height_m : {0.0, 0.002, -0.0015}) {
    const RenderedPartFrame frame = Render(*scene, FromAbove(height_m));
    // Sheet through the origin at -30 degrees to the vertical: x = h tan(-30 deg), seen at v =
    // b x / (d_c - h); b of the pinhole is the focal length (lens without a focus distance).
    const double x = height_m * std::tan(-std::numbers::pi / 6);
    const double row = kAxisRow + 0.016 * x / (0.3 - height_m) / 5.3e-6;
    EXPECT_NEAR(LineRow(frame.image.mean_photo_electrons), row, 0.05) << height_m;
  }
}

TEST(PartFrame, TableIsUnderTheLowestPointOfATiltedPart) {
  // Two triangles of sheet metal, flat and without a hull, on both sides of what the camera sees.
  const auto scene = SceneOf(
      "v -0.1 -0.1 0\nv 0.1 -0.1 0\nv 0 -0.05 0\nv -0.1 0.1 0\nv 0.1 0.1 0\nv 0 0.05 0\n"
      "f 1 2 3\nf 5 4 6\n",
      R"(, "obstacles": [{"file": "table.obj", "unit": "m", "frame": "FRAME_TABLE"}],
                 "render": {"laser_interreflection": false, "speckle": false})");
  for (const double tilt_rad : {0.0, 0.01, -0.02}) {
    Measurement measurement = FromAbove(0);
    measurement.part_alpha_rad = tilt_rad;
    const double height_m = -0.1 * std::abs(std::sin(tilt_rad));
    const double x = height_m * std::tan(-std::numbers::pi / 6);
    const double row = kAxisRow + 0.016 * x / (0.3 - height_m) / 5.3e-6;
    EXPECT_NEAR(LineRow(Render(*scene, measurement).image.mean_photo_electrons), row, 0.05)
        << tilt_rad;
  }
}

TEST(PartFrame, AmbientLightOnAMattPlane) {
  // A plane under the same radiance from everywhere reflects albedo times it.
  const auto scene = TableScene(R"(, "lighting": {"ambient": {"radiance_w_m2_sr": 2,
      "spectrum": {"illuminant": "d65"}}}, "render": {"laser_interreflection": false, "exposure_time_s": 0.01})");
  const RenderedPartFrame with_laser = Render(*scene, FromAbove(0));
  v1::SourceSpectrum d65;
  d65.set_illuminant("d65");
  const auto spectrum = ParseSourceSpectrum(d65, "");
  ASSERT_TRUE(spectrum.ok());
  const double electrons_per_joule =
      Integrate(*spectrum, ElectronsPerJoule(scene->inspection().sensor->quantum_efficiency[0]));
  const double b = 1 / (1 / 0.016 - 1 / 0.3);
  const double expected = std::numbers::pi / 4 * 0.9 * std::pow(0.016 / 11 / b, 2) * 0.5 * 2 *
                          electrons_per_joule * 5.3e-6 * 5.3e-6 * 0.01;
  // Away from the line; cos^4 is above 0.9994 in this small field. The mean over the rows has a
  // standard error below 0.01 / sqrt(96).
  const Image<float>& flux = with_laser.image.light.incoherent_electron_flux_m2_s[0];
  double sum = 0;
  for (const float value : flux.values) sum += value;
  const double electrons = sum / static_cast<double>(flux.values.size()) * 5.3e-6 * 5.3e-6 * 0.01;
  EXPECT_NEAR(electrons / expected, 1, 0.003);
}

TEST(PartFrame, MotionAlongTheSurfaceLeavesTheLineAndAveragesSpeckle) {
  // 5 px of motion during the exposure, along the image columns.
  const double travel_m = 5 * 5.3e-6 * 0.3 / 0.016;
  const std::string moving =
      absl::StrCat(R"("exposure_time_s": 0.01, "stage_speed_m_per_s": )", travel_m / 0.01);
  const auto contrast = [](const Image<double>& image) {
    // Along the line: the table is uniform.
    const int row = kRows / 2;
    double sum = 0, squares = 0;
    for (int column = 0; column < kColumns; ++column) {
      sum += image.At(row, column);
      squares += image.At(row, column) * image.At(row, column);
    }
    const double mean = sum / kColumns;
    return std::sqrt(squares / kColumns - mean * mean) / mean;
  };
  const auto still_scene =
      TableScene(R"(, "render": {"laser_interreflection": false, "exposure_time_s": 0.01})");
  const auto moving_scene =
      TableScene(absl::StrCat(R"(, "render": {"laser_interreflection": false, )", moving, "}"));
  const double still = contrast(Render(*still_scene, FromAbove(0)).image.mean_photo_electrons);
  const double moved = contrast(Render(*moving_scene, FromAbove(0)).image.mean_photo_electrons);
  // 5 px are 3.4 speckles of lambda b / D: contrast falls by about sqrt(3.4) = 1.9, estimated from
  // some 70 independent speckles along the row (relative standard error 1 / sqrt(2 70) = 8 %).
  EXPECT_GT(still, 0.3);
  EXPECT_LT(moved, still / 1.3);
  EXPECT_GT(moved, still / 3.5);

  const auto smooth = TableScene(
      R"(, "render": {"laser_interreflection": false, "exposure_time_s": 0.01, "speckle": false})");
  const auto smooth_moving = TableScene(absl::StrCat(
      R"(, "render": {"laser_interreflection": false, "speckle": false, )", moving, "}"));
  const std::vector<double> a = Profile(Render(*smooth, FromAbove(0)).image.mean_photo_electrons);
  const std::vector<double> b =
      Profile(Render(*smooth_moving, FromAbove(0)).image.mean_photo_electrons);
  const double peak = *std::max_element(a.begin(), a.end());
  for (int row = 0; row < kRows; ++row) EXPECT_NEAR(a[row], b[row], 0.01 * peak) << row;
}

TEST(PartFrame, SameSurfaceSameSpeckleOtherNoise) {
  const auto scene =
      TableScene(R"(, "render": {"laser_interreflection": false, "exposure_time_s": 0.01})");
  const FrameSetup a = PartFrameSetup(scene->inspection(), {FromAbove(0), 0.001});
  const FrameSetup b = PartFrameSetup(scene->inspection(), {FromAbove(0), 0.001});
  const FrameSetup c = PartFrameSetup(scene->inspection(), {FromAbove(0), 0.002});
  EXPECT_EQ(a.seeds.speckle, b.seeds.speckle);
  EXPECT_NE(a.seeds.speckle, c.seeds.speckle);
  EXPECT_NE(a.seeds.noise, c.seeds.noise);
  EXPECT_EQ(a.seeds.camera, c.seeds.camera);
}

TEST(PartFrame, EffectsOfPlatesAreRefused) {
  const auto scene = TableScene("");
  const auto effect = MakeActiveEffect("surface.albedo_error", {{"amplitude_factor", 1.1}});
  ASSERT_TRUE(effect.ok()) << effect.status();
  const std::vector<ActiveEffect> effects = {*effect};
  const auto frame = RenderPartFrame(*scene, {FromAbove(0), 0}, effects, false, {});
  EXPECT_TRUE(absl::IsInvalidArgument(frame.status())) << frame.status();
  EXPECT_THAT(std::string(frame.status().message()), HasSubstr("surface.albedo_error"));
}

// An error of the camera's distance is one of the pose: the line of a raised table moves.
TEST(PartFrame, GeometryErrorsMoveTheCamera) {
  const auto scene =
      TableScene(R"(, "render": {"laser_interreflection": false, "speckle": false})");
  const auto effect =
      MakeActiveEffect("geometry.camera_distance_error", {{"camera_distance_shift_m", 0.01}});
  ASSERT_TRUE(effect.ok()) << effect.status();
  const std::vector<ActiveEffect> effects = {*effect};
  RenderLimits limits;
  const auto frame = RenderPartFrame(*scene, {FromAbove(0.002), 0}, effects, false, limits);
  ASSERT_TRUE(frame.ok()) << frame.status();
  const double x = 0.002 * std::tan(-std::numbers::pi / 6);
  const double row = kAxisRow + 0.016 * x / (0.31 - 0.002) / 5.3e-6;
  EXPECT_NEAR(LineRow(frame->image.mean_photo_electrons), row, 0.05);
}

}  // namespace
}  // namespace sightline
