// SPDX-License-Identifier: Apache-2.0
// Shot lists: complete, within the rig's bounds, exposed well, and accepted once recorded.
#include "core/recordings/shot_list.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <set>

#include "absl/status/status.h"
#include "core/field_limits/field_checks.h"
#include "core/json/strict_json.h"
#include "core/recordings/check/check_recordings.h"
#include "core/recordings/expected_line.h"
#include "tests/render_worker/verification/small_set.h"

namespace sightline {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

Inspection RigOf(const RecordingSet& set) {
  Inspection inspection;
  inspection.name = "rig";
  inspection.sensor = set.camera;
  Lens lens;
  lens.focal_length_m = set.focal_length_m;
  lens.focus_distance_m = 0.33;
  lens.transmission = set.transmission;
  inspection.rig.lens = lens;
  inspection.rig.laser = set.laser;
  inspection.rig.laser.distance_m = 0.4;
  MaterialChoice material;
  auto* ggx = material.material.mutable_lambert_ggx();
  ggx->set_diffuse_albedo(0.35);
  ggx->set_specular_f0(0.6);
  ggx->set_ggx_alpha(0.4);
  inspection.materials = {material};
  inspection.domain = ThesisDomain();
  return inspection;
}

ShotList Plan(const Inspection& inspection, int images) {
  auto list = PlanShotList(inspection, "rig.json", images);
  EXPECT_TRUE(list.ok()) << list.status();
  return *std::move(list);
}

TEST(ShotListOfARig, CoversWhatTellsEffectsApart) {
  for (const ColourFilter filter : {ColourFilter::kMono, ColourFilter::kBayerRggb}) {
    const ShotList list = Plan(RigOf(SmallSet(filter)), 44);
    const RecordingSet& set = list.set;
    EXPECT_GE(set.recordings.size(), 44u);
    EXPECT_LE(set.recordings.size(), 52u);
    std::map<std::string, int> series;
    std::set<double> f_numbers, distances, focus, laser, dark_exposures, sweep_exposures;
    std::set<int> sweep_positions;
    for (const RecordedImage& image : set.recordings) {
      ++series[image.series];
      if (image.kind == RecordingKind::kDark) {
        dark_exposures.insert(image.exposure_time_s);
        continue;
      }
      f_numbers.insert(image.f_number);
      distances.insert(image.camera_distance_m);
      focus.insert(image.focus_distance_m);
      laser.insert(image.laser_distance_m);
      if (image.series == "exposure_sweep") {
        sweep_exposures.insert(image.exposure_time_s);
        sweep_positions.insert(*image.plate_position_id);
      }
    }
    for (const char* name : {"aperture", "exposure_sweep", "noise", "field", "laser_distance",
                             "distance", "focus", "shifted_plate", "dark"}) {
      EXPECT_GT(series[name], 0) << name;
    }
    EXPECT_GE(f_numbers.size(), 7u);
    EXPECT_GE(distances.size(), 4u);
    EXPECT_GE(focus.size(), 3u);
    EXPECT_GE(laser.size(), 3u);
    EXPECT_GE(dark_exposures.size(), 4u);
    EXPECT_EQ(sweep_positions.size(), 1u);
    EXPECT_GE(*sweep_exposures.rbegin() / *sweep_exposures.begin(), 30);
    EXPECT_EQ(set.recordings.front().series, "shifted_plate");
    EXPECT_THAT(set.recordings.back().series, testing::AnyOf("shifted_plate", "dark"));
  }
}

TEST(ShotListOfARig, IsAcceptedAsRecordings) {
  const ShotList list = Plan(RigOf(SmallSet(ColourFilter::kBayerRggb)), 60);
  v1::Recordings message;
  std::string json = RecordingsToJson(RecordingsToProto(list.set));
  // JSON null stands where messages have none.
  for (size_t at; (at = json.find("\"plate_position_id\": null")) != std::string::npos;) {
    json.replace(at, 25, "\"plate_position_id\": -2147483648");
  }
  ASSERT_TRUE(ParseStrictJson(json, "recordings.json", &message).ok());
  const auto parsed = ParseRecordings(message, "recordings.json");
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  EXPECT_EQ(parsed->recordings.size(), list.set.recordings.size());
  EXPECT_GT(parsed->uncertainty.diffuse_albedo_relative, 0);
}

TEST(ShotListOfARig, ExposesTheCrestBelowTheLimit) {
  const ShotList list = Plan(RigOf(SmallSet(ColourFilter::kMono)), 44);
  for (const RecordedImage& image : list.set.recordings) {
    if (image.kind == RecordingKind::kDark || image.series == "exposure_sweep") continue;
    const ExpectedLine line = ExpectLine(list.set, image);
    const double share = line.CrestDn(list.set.camera, 0) / list.set.camera.largest_dn();
    EXPECT_LE(share, 0.72) << image.file;
    EXPECT_GE(share, 0.2) << image.file;
    // Gamma law of contrast C: three deviations above the mean do not reach the limit.
    EXPECT_LE(share * (1 + 3 * std::sqrt(line.speckle_contrast_squared)), 1.06) << image.file;
    EXPECT_GE(image.exposure_time_s, 2e-5);
    EXPECT_LE(image.exposure_time_s, 2);
  }
}

TEST(ShotListOfARig, StaysWithinItsBounds) {
  Inspection inspection = RigOf(SmallSet(ColourFilter::kMono));
  inspection.domain.parameters[0].ranges = {{0.28, 0.36}};
  inspection.domain.parameters[1].ranges = {{Radians(-32), Radians(-20)}};
  const ShotList narrow = Plan(inspection, 44);
  EXPECT_NEAR(narrow.set.incidence_angle_rad, Radians(32), 1e-9);
  for (const RecordedImage& image : narrow.set.recordings) {
    EXPECT_GE(image.camera_distance_m, 0.28 - 1e-9);
    EXPECT_LE(image.camera_distance_m, 0.36 + 1e-9);
  }
  inspection.domain.parameters[0].ranges = {};
  inspection.domain.parameters[0].values = {0.31};
  const ShotList fixed = Plan(inspection, 44);
  for (const RecordedImage& image : fixed.set.recordings) {
    EXPECT_NEAR(image.camera_distance_m, 0.31, 1e-9);
  }
  EXPECT_THAT(fixed.notes, testing::Contains(HasSubstr("no distance series")));
  EXPECT_GE(fixed.set.recordings.size(), 44u);
}

TEST(ShotListOfARig, LeavesOutWhatNoCameraCanExpose) {
  Inspection inspection = RigOf(SmallSet(ColourFilter::kMono));
  inspection.rig.laser.power_w = 0.02;
  const ShotList list = Plan(inspection, 44);
  EXPECT_THAT(list.notes, testing::Contains(HasSubstr("f/1.4")));
  for (const RecordedImage& image : list.set.recordings) {
    EXPECT_GE(image.exposure_time_s, 2e-5) << image.file;
  }
  inspection.rig.laser.power_w = 1e-12;
  const auto none = PlanShotList(inspection, "rig.json", 44);
  ASSERT_TRUE(absl::IsInvalidArgument(none.status()));
  EXPECT_THAT(std::string(none.status().message()),
              testing::AllOf(HasSubstr("rig.json"), HasSubstr("laser.power_w")));
}

TEST(ShotListOfARig, NamesWhatIsMissing) {
  const Inspection complete = RigOf(SmallSet(ColourFilter::kMono));
  const auto message = [](const Inspection& inspection, int images) {
    return std::string(PlanShotList(inspection, "rig.json", images).status().message());
  };
  Inspection inspection = complete;
  inspection.sensor.reset();
  EXPECT_THAT(message(inspection, 44), HasSubstr("camera.sensor_file"));
  inspection = complete;
  inspection.rig.lens.reset();
  EXPECT_THAT(message(inspection, 44), HasSubstr("lens is missing"));
  EXPECT_THAT(message(complete, 3), HasSubstr("images is 3, must be in [12, 500]"));
}

TEST(ShotListOfARig, TextNamesEveryFile) {
  const ShotList list = Plan(RigOf(SmallSet(ColourFilter::kMono)), 44);
  const std::string text = ShotListText(list);
  for (const RecordedImage& image : list.set.recordings) EXPECT_THAT(text, HasSubstr(image.file));
}

// Recorded by the renderer, on a small sensor: nothing to complain of.
TEST(ShotListOfARig, IsUsableOnceRecorded) {
  RecordingSet small = SmallSet(ColourFilter::kMono);
  small.camera.columns_px = 144;
  small.camera.rows_px = 128;
  const ShotList list = Plan(RigOf(small), 20);
  const RecordingCheck check = CheckRecordings(list.set, RenderSet(list.set, 3));
  EXPECT_THAT(check.errors, IsEmpty());
  EXPECT_THAT(check.warnings, IsEmpty());
  for (size_t i = 0; i < check.recordings.size(); ++i) {
    const RecordedImage& image = list.set.recordings[i];
    if (image.kind == RecordingKind::kDark || image.series == "exposure_sweep") continue;
    EXPECT_TRUE(check.recordings[i].line_found) << image.file;
    EXPECT_LT(check.recordings[i].saturated_fraction, 0.005) << image.file;
  }
}

}  // namespace
}  // namespace sightline
