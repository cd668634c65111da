// SPDX-License-Identifier: Apache-2.0
#include "core/inspection/inspection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <random>

#include "absl/strings/str_cat.h"
#include "core/inspection/read_with_files.h"
#include "core/json/strict_json.h"
#include "core/physics/angle.h"
#include "tests/core/inspection/parse_fields.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(Inspection, DefaultsAreThoseOfTheSchema) {
  const absl::StatusOr<Inspection> parsed = ParseFields("");
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  const Inspection& i = *parsed;
  EXPECT_EQ(i.part_file, "parts/a.glb");
  EXPECT_EQ(i.rig.camera.columns_px, 512);
  EXPECT_EQ(i.rig.camera.rows_px, 512);
  EXPECT_NEAR(i.rig.camera.vertical_fov_rad, 45 * kRadPerDeg, 1e-15);
  EXPECT_NEAR(i.rig.laser.fan_angle_rad, 90 * kRadPerDeg, 1e-15);
  EXPECT_FALSE(i.rig.laser.distance_m);
  EXPECT_EQ(i.rig.scan_step_m, 0.001);
  EXPECT_EQ(i.rig.stage_travel_m, 1);
  EXPECT_EQ(i.rig.max_range_m, 1.5);
  EXPECT_EQ(i.rig.clearance_m, 0.005);
  EXPECT_EQ(i.rig.camera_bodies.size(), 1u);
  EXPECT_EQ(i.targets.spacing_m, 0.005);
  EXPECT_EQ(i.targets.coverage_radius_m, 0.003);
  EXPECT_NEAR(i.targets.max_normal_angle_rad, 30 * kRadPerDeg, 1e-15);
  EXPECT_EQ(i.goal.coverage, 0.95);
  EXPECT_EQ(i.goal.max_scans, 40);
  EXPECT_EQ(i.goal.min_gain, 0.0002);
  EXPECT_EQ(i.costs.stage_speed_m_per_s, 0.05);
  EXPECT_EQ(i.costs.lay_time_s, 180);
  EXPECT_EQ(i.costs.turn_time_s, 60);
  EXPECT_EQ(i.costs.move_sensors_time_s, 900);
  EXPECT_TRUE(i.domain.resting_orientations.empty());
}

TEST(Inspection, ClearanceIsNoneByTheOldDefaults) {
  EXPECT_EQ(ParseFields(R"("defaults": "0.1")")->rig.clearance_m, 0);
  EXPECT_EQ(ParseFields(R"("defaults": "0.1", "rig": {"clearance_m": 0.02})")->rig.clearance_m,
            0.02);
  EXPECT_EQ(ParseFields(R"("rig": {"clearance_m": 0})")->rig.clearance_m, 0);
}

TEST(Inspection, ValuesArriveInRadians) {
  const absl::StatusOr<Inspection> i = ParseFields(
      R"("camera": {"vertical_fov_deg": 30, "pixel_pitch_m": 5e-6},
         "lens": {"focal_length_m": 0.0048, "f_number": 4},
         "laser": {"distance_m": 0.3, "fan_angle_deg": 60},
         "targets": {"max_normal_angle_deg": 45, "max_circle_of_confusion_px": 2,
                     "regions": [{"name": "bore", "min_m": {"x": -1, "y": -1, "z": -1},
                                  "max_m": {"x": 1, "y": 1, "z": 1}, "spacing_m": 0.001}]},
         "rig": {"camera_bodies": [{"centre_m": {"z": -0.1},
                                    "cylinder": {"radius_m": 0.05, "length_m": 0.2}}]},
         "goal": {"coverage": 1, "max_time_s": 10},
         "costs": {"reposition_speed_deg_per_s": 90})");
  ASSERT_TRUE(i.ok()) << i.status();
  EXPECT_NEAR(i->rig.camera.vertical_fov_rad, 30 * kRadPerDeg, 1e-15);
  EXPECT_NEAR(i->rig.laser.fan_angle_rad, 60 * kRadPerDeg, 1e-15);
  EXPECT_EQ(i->rig.lens->f_number, 4);
  EXPECT_NEAR(i->targets.max_normal_angle_rad, 45 * kRadPerDeg, 1e-15);
  EXPECT_EQ(i->targets.regions.at(0).spacing_m, 0.001);
  ASSERT_EQ(i->rig.camera_bodies.size(), 1u);
  EXPECT_EQ(std::get<CylinderBody>(i->rig.camera_bodies[0]).radius_m, 0.05);
  EXPECT_NEAR(*i->costs.reposition_speed_rad_per_s, 90 * kRadPerDeg, 1e-15);
  EXPECT_FALSE(i->costs.IsUnit());
}

struct BadField {
  std::string fields, path, value, range;
};

class InspectionErrorTest : public ::testing::TestWithParam<BadField> {};

TEST_P(InspectionErrorTest, NamesFileFieldValueAndRange) {
  const BadField& bad = GetParam();
  EXPECT_THAT(ErrorOfFields(bad.fields), AllOf(HasSubstr("bracket.json: " + bad.path + " "),
                                               HasSubstr(bad.value), HasSubstr(bad.range)));
}

INSTANTIATE_TEST_SUITE_P(
    Fields, InspectionErrorTest,
    ::testing::Values(
        BadField{R"("camera": {"columns_px": 15})", "camera.columns_px", "15", "[16, 16384]"},
        BadField{R"("camera": {"rows_px": 16385})", "camera.rows_px", "16385", "[16, 16384]"},
        BadField{R"("camera": {"vertical_fov_deg": 0})", "camera.vertical_fov_deg", "0",
                 "(0, 170)"},
        BadField{R"("camera": {"vertical_fov_deg": 170})", "camera.vertical_fov_deg", "170",
                 "(0, 170)"},
        BadField{R"("camera": {"pixel_pitch_m": 5})", "camera.pixel_pitch_m", "5", "0.001]"},
        BadField{R"("lens": {"focal_length_m": 16, "f_number": 8})", "lens.focal_length_m", "16",
                 "0.1) m"},
        BadField{R"("lens": {"f_number": 8})", "lens.focal_length_m", "missing", ""},
        BadField{R"("lens": {"focal_length_m": 0.016})", "lens.f_number", "missing", ""},
        BadField{R"("laser": {"fan_angle_deg": 180})", "laser.fan_angle_deg", "180", "(0, 180)"},
        BadField{R"("laser": {"distance_m": -1})", "laser.distance_m", "-1", "["},
        BadField{R"("rig": {"scan_step_m": 0})", "rig.scan_step_m", "0", "[0.00001, 0.1] m"},
        BadField{R"("rig": {"scan_step_m": 0.2})", "rig.scan_step_m", "0.2", "[0.00001, 0.1] m"},
        BadField{R"("rig": {"stage_travel_m": 0})", "rig.stage_travel_m", "0", "(0, 20] m"},
        BadField{R"("rig": {"stage_travel_m": 21})", "rig.stage_travel_m", "21", "(0, 20] m"},
        BadField{R"("rig": {"max_range_m": 0})", "rig.max_range_m", "0", "(0, "},
        BadField{R"("rig": {"clearance_m": -0.001})", "rig.clearance_m", "-0.001", "[0, 1] m"},
        BadField{R"("rig": {"clearance_m": 2})", "rig.clearance_m", "2", "[0, 1] m"},
        BadField{R"("rig": {"laser_bodies": [{"box": {}}]})", "rig.laser_bodies[0].centre_m",
                 "missing", ""},
        BadField{R"("rig": {"laser_bodies": [{"centre_m": {}}]})", "rig.laser_bodies[0]", "shape",
                 "box or cylinder"},
        BadField{
            R"("rig": {"laser_bodies": [{"centre_m": {}, "box": {"size_m": {"x": 1, "y": 1}}}]})",
            "rig.laser_bodies[0].box.size_m.z", "0", "(0, 10] m"},
        BadField{R"("rig": {"laser_bodies": [{"centre_m": {}, "cylinder": {"radius_m": 1}}]})",
                 "rig.laser_bodies[0].cylinder.length_m", "0", "(0, 10] m"},
        BadField{R"("targets": {"spacing_m": 2})", "targets.spacing_m", "2", "[0.0001, 1] m"},
        BadField{R"("targets": {"coverage_radius_m": 0})", "targets.coverage_radius_m", "0", "(0"},
        BadField{R"("targets": {"max_normal_angle_deg": 91})", "targets.max_normal_angle_deg", "91",
                 "(0, 90] deg"},
        BadField{R"("targets": {"regions": [{"name": "r", "min_m": {"x": 1}, "max_m": {"x": 1},
                                             "spacing_m": 0.001}]})",
                 "targets.regions[0].max_m.x", "1", "above"},
        BadField{R"("targets": {"regions": [{"name": "r", "min_m": {}, "spacing_m": 0.001}]})",
                 "targets.regions[0].max_m", "missing", ""},
        BadField{R"("targets": {"regions": [{"name": "r", "min_m": {},
                                             "max_m": {"x": 1, "y": 1, "z": 1}}]})",
                 "targets.regions[0].spacing_m", "missing", ""},
        BadField{R"("targets": {"max_circle_of_confusion_px": 1})", "lens", "missing",
                 "max_circle_of_confusion_px"},
        BadField{R"("targets": {"max_circle_of_confusion_px": 1},
                    "lens": {"focal_length_m": 0.016, "f_number": 8})",
                 "camera.pixel_pitch_m", "missing", "max_circle_of_confusion_px"},
        BadField{R"("obstacles": [{"frame": "FRAME_PART"}])", "obstacles[0].file", "missing", ""},
        BadField{R"("obstacles": [{"file": "a.glb"}])", "obstacles[0].frame", "missing",
                 "FRAME_STAGE"},
        BadField{R"("obstacles": [{"file": "a.stl", "frame": "FRAME_PART"}])", "obstacles[0].unit",
                 "missing", "mm"},
        BadField{R"("goal": {"coverage": 0})", "goal.coverage", "0", "(0, 1]"},
        BadField{R"("goal": {"coverage": 95})", "goal.coverage", "95", "(0, 1]"},
        BadField{R"("goal": {"max_scans": 0})", "goal.max_scans", "0", "[1, 1000]"},
        BadField{R"("goal": {"max_time_s": -1})", "goal.max_time_s", "-1", "(0"},
        BadField{R"("goal": {"min_gain": -0.1})", "goal.min_gain", "-0.1", "[0, 1)"},
        BadField{R"("costs": {"reposition_time_s": -2})", "costs.reposition_time_s", "-2", "[0"},
        BadField{R"("costs": {"stage_speed_m_per_s": 0})", "costs.stage_speed_m_per_s", "0", "(0"},
        BadField{R"("costs": {"frame_rate_hz": -30})", "costs.frame_rate_hz", "-30", "(0"}));

INSTANTIATE_TEST_SUITE_P(
    Domains, InspectionErrorTest,
    ::testing::Values(
        BadField{R"("measurement": {"camera_distance_m": {"fixed": 0.9}})",
                 "measurement.camera_distance_m.fixed", "0.9", "[0.1, 0.8] m"},
        BadField{R"("measurement": {"triangulation_angle_deg": {"fixed": 5}})",
                 "measurement.triangulation_angle_deg.fixed", "5", "[-80, -10] or [10, 80] deg"},
        BadField{
            R"("measurement": {"triangulation_angle_deg": {"ranges": [{"min": -20, "max": 20}]}})",
            "measurement.triangulation_angle_deg.ranges[0]", "[-20, 20]",
            "[-80, -10] or [10, 80] deg"},
        BadField{R"("measurement": {"camera_azimuth_deg": {"values": [0, 360]}})",
                 "measurement.camera_azimuth_deg.values[1]", "360", "[0, 360) deg"},
        BadField{R"("measurement": {"part_gamma_deg": {"ranges": [{"min": 350, "max": 10}]}})",
                 "measurement.part_gamma_deg.ranges[0]", "350", "two ranges"},
        BadField{R"("measurement": {"camera_polar_deg": {"ranges": [{"min": 0, "max": 91}]}})",
                 "measurement.camera_polar_deg.ranges[0]", "[0, 91]", "[0, 90] deg"},
        BadField{R"("measurement": {"offset_y_m": {"fixed": 0.6}})", "measurement.offset_y_m.fixed",
                 "0.6", "[-0.5, 0.5] m"},
        BadField{R"("measurement": {"offset_z_m": {"fixed": -0.5}})",
                 "measurement.offset_z_m.fixed", "-0.5", "[-0.4, 0.4] m"},
        BadField{R"("measurement": {"offset_z_m": {}})", "measurement.offset_z_m", "none",
                 "exactly one"},
        BadField{R"("measurement": {"offset_z_m": {"fixed": 0, "values": [0]}})",
                 "measurement.offset_z_m", "several", "exactly one"},
        BadField{R"("measurement": {"part_beta_deg": {"fixed": 0},
                                    "resting_orientations": [{"part_alpha_deg": 0}]})",
                 "measurement.part_beta_deg", "together", "resting_orientations"},
        BadField{R"("measurement": {"resting_orientations": [{}, {"part_beta_deg": -90}]})",
                 "measurement.resting_orientations[1].part_beta_deg", "-90", "[0, 360) deg"}));

TEST(Inspection, MissingPartFileNamesTheField) {
  const absl::StatusOr<Inspection> inspection = ParseInspection({}, "bracket.json", "");
  EXPECT_EQ(inspection.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(inspection.status().message()),
              AllOf(HasSubstr("bracket.json"), HasSubstr("part.file is missing")));
}

TEST(Inspection, UnitIsNeededWhereTheFormatHasNone) {
  v1::Inspection message;
  message.mutable_part()->set_file("a.STL");
  EXPECT_THAT(std::string(ParseInspection(message, "f", "").status().message()),
              HasSubstr("part.unit is missing"));
  message.mutable_part()->set_unit("furlong");
  EXPECT_THAT(std::string(ParseInspection(message, "f", "").status().message()),
              AllOf(HasSubstr("part.unit is \"furlong\""), HasSubstr("mm")));
  message.mutable_part()->set_unit("mm");
  EXPECT_TRUE(ParseInspection(message, "f", "").ok());
}

TEST(Inspection, FilesAreResolvedAgainstTheInspectionsFolder) {
  v1::Inspection message;
  message.mutable_part()->set_file("../cad/a.glb");
  v1::Obstacle* obstacle = message.add_obstacles();
  obstacle->set_file("/abs/table.glb");
  obstacle->set_frame(v1::Obstacle::FRAME_STAGE);
  const absl::StatusOr<Inspection> inspection = ParseInspection(message, "f", "/jobs/one");
  ASSERT_TRUE(inspection.ok());
  EXPECT_EQ(inspection->part_file, "/jobs/cad/a.glb");
  EXPECT_EQ(inspection->obstacles[0].file, "/abs/table.glb");
  EXPECT_EQ(inspection->obstacles[0].frame, ObstacleFrame::kStage);
}

TEST(Inspection, ReadsAFile) {
  const std::filesystem::path folder = std::filesystem::path(::testing::TempDir()) /
                                       ("inspection_" + std::to_string(std::random_device()()));
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "i.json") << R"({"name": "n", "part": {"file": "p.glb"}})";
  const absl::StatusOr<Inspection> inspection = ReadInspection((folder / "i.json").string());
  ASSERT_TRUE(inspection.ok()) << inspection.status();
  EXPECT_EQ(inspection->name, "n");
  EXPECT_EQ(inspection->part_file, (folder / "p.glb").string());
  EXPECT_EQ(ReadInspection((folder / "none.json").string()).status().code(),
            absl::StatusCode::kNotFound);
  std::filesystem::remove_all(folder);
}

TEST(Inspection, SaysAllThatIsWrongAtOnce) {
  v1::Inspection message;
  const std::string json = R"({
    "part": {"file": "a.stl"},
    "lens": {"transmission": 2},
    "laser": {"fan_angle_deg": 200},
    "targets": {"spacing_m": 9, "regions": [{"name": "r"}, {"name": "r", "spacing_m": 1}]},
    "measurement": {"part_alpha_deg": {}, "offset_y_m": {"fixed": 2}},
    "obstacles": [{"file": "b.stl", "unit": "mm"}, {"frame": "FRAME_WORLD"}],
    "goal": {"coverage": 2, "max_scans": 0},
    "costs": {"frame_rate_hz": -1}
  })";
  ASSERT_TRUE(ParseStrictJson(json, "i.json", &message).ok());
  const std::string error(ParseInspection(message, "i.json", "").status().message());
  for (const char* line :
       {"part.unit is missing", "lens.focal_length_m is missing", "lens.f_number is missing",
        "laser.fan_angle_deg is 200", "targets.spacing_m is 9",
        "targets.regions[0].min_m is missing", "targets.regions[0].spacing_m is missing",
        "targets.regions[1].name is \"r\" like that", "measurement.part_alpha_deg has none",
        "measurement.offset_y_m.fixed is 2", "obstacles[0].frame is missing",
        "obstacles[1].file is missing", "goal.coverage is 2", "goal.max_scans is 0",
        "costs.frame_rate_hz is -1"}) {
    EXPECT_THAT(error, HasSubstr(absl::StrCat("i.json: ", line)));
  }
}

TEST(Inspection, NamesAllFilesThatAreNotThere) {
  const std::filesystem::path folder = std::filesystem::path(::testing::TempDir()) /
                                       ("inspection_" + std::to_string(std::random_device()()));
  std::filesystem::create_directories(folder);
  const std::string path = (folder / "i.json").string();
  std::ofstream(path) << R"({"part": {"file": "p.glb"}, "camera": {"sensor_file": "c.json"},
    "materials": [{"file": "m.json"}], "tolerances": {"file": "t.stp"},
    "obstacles": [{"file": "o.glb", "frame": "FRAME_PART"}, {"file": "p2.glb", "frame": "FRAME_PART"}],
    "goal": {"coverage": 3}})";
  std::ofstream(folder / "p2.glb") << "there";
  const absl::Status status = ReadInspectionWithFiles(path).status();
  const std::string error(status.message());
  for (const char* file : {"p.glb", "c.json", "m.json", "t.stp", "o.glb"}) {
    EXPECT_THAT(error, HasSubstr((folder / file).string()));
  }
  EXPECT_THAT(error, AllOf(HasSubstr("obstacles[0].file: no file"), HasSubstr("goal.coverage is 3"),
                           ::testing::Not(HasSubstr("p2.glb"))));
  // Files that nothing needs are not looked for.
  std::ofstream(path) << R"({"part": {"file": "p.glb"}})";
  EXPECT_TRUE(ReadInspection(path).ok());
  EXPECT_EQ(ReadInspectionWithFiles(path).status().code(), absl::StatusCode::kNotFound);
  std::ofstream(folder / "p.glb") << "there";
  EXPECT_TRUE(ReadInspectionWithFiles(path).ok());
  std::filesystem::remove_all(folder);
}

// Whether a STEP file states its unit is known only when it is read.
TEST(Inspection, AStepFileMayNeedAUnit) {
  v1::Inspection message;
  message.mutable_part()->set_file("a.STEP");
  EXPECT_TRUE(ParseInspection(message, "f", "").ok());
  message.mutable_part()->set_unit("mm");
  EXPECT_TRUE(ParseInspection(message, "f", "").ok());
  message.mutable_part()->set_unit("furlong");
  EXPECT_THAT(std::string(ParseInspection(message, "f", "").status().message()),
              HasSubstr("part.unit is \"furlong\""));
}

TEST(Inspection, TheFileOfTolerancesHasItsUnit) {
  const auto parse = [](const std::string& part_unit, const std::string& tolerances) {
    v1::Inspection message;
    const std::string json = absl::StrCat(R"({"part": {"file": "a.stp", "unit": ")", part_unit,
                                          R"("}, "tolerances": {)", tolerances, "}}");
    EXPECT_TRUE(ParseStrictJson(json, "f", &message).ok());
    return ParseInspection(message, "f", "");
  };
  const auto unit_of = [&](const std::string& part_unit, const std::string& tolerances) {
    const auto inspection = parse(part_unit, tolerances);
    EXPECT_TRUE(inspection.ok()) << inspection.status();
    return inspection.ok() ? inspection->tolerances->file_unit : "refused";
  };
  EXPECT_EQ(unit_of("", R"("file": "b.qif")"), "");
  EXPECT_EQ(unit_of("inch", R"("file": "b.qif")"), "");
  EXPECT_EQ(unit_of("", R"("file": "b.qif", "unit": "Millimeters")"), "mm");
  EXPECT_EQ(unit_of("inch", R"("file": "a.stp")"), "inch");
  EXPECT_EQ(unit_of("inch", R"("file": "a.stp", "unit": "in")"), "inch");
  for (const auto& [part_unit, tolerances, reason] :
       {std::tuple("inch", R"("file": "a.stp", "unit": "mm")",
                   "part.unit of the same file is inch"),
        std::tuple("", R"("file": "a.stp", "unit": "mm")", "is not given"),
        std::tuple("", R"("file": "b.qif", "unit": "furlong")", "\"furlong\""),
        std::tuple("", R"("zone_width_m": 1e-4, "unit": "mm")", "without tolerances.file")}) {
    EXPECT_THAT(std::string(parse(part_unit, tolerances).status().message()),
                AllOf(HasSubstr("f: tolerances.unit "), HasSubstr(reason)));
  }
}

TEST(Inspection, AssociationIsThatOfTolerancesOfAFile) {
  const auto parse = [](const std::string& tolerances) {
    v1::Inspection message;
    const std::string json =
        absl::StrCat(R"({"part": {"file": "a.stp"}, "tolerances": {)", tolerances, "}}");
    EXPECT_TRUE(ParseStrictJson(json, "f", &message).ok()) << json;
    return ParseInspection(message, "f", "");
  };
  const auto association_of = [&](const std::string& tolerances) {
    const auto inspection = parse(tolerances);
    EXPECT_TRUE(inspection.ok()) << inspection.status();
    return inspection.ok() ? inspection->tolerances->association : Association::kGauss;
  };
  EXPECT_EQ(association_of(R"("file": "a.stp")"), Association::kGauss);
  EXPECT_EQ(association_of(R"("file": "a.stp", "association": "GAUSS")"), Association::kGauss);
  EXPECT_EQ(association_of(R"("file": "a.stp", "association": "CHEBYSHEV")"),
            Association::kChebyshev);
  EXPECT_THAT(
      std::string(parse(R"("zone_width_m": 1e-4, "association": "CHEBYSHEV")").status().message()),
      HasSubstr("f: tolerances.association is CHEBYSHEV, which needs tolerances.file"));
}

// --- domains ------------------------------------------------------------------------------------

TEST(MeasurementDomain, DefaultIsTable21) {
  const MeasurementDomain domain = ParseFields("")->domain;
  Measurement m;  // inside
  EXPECT_TRUE(domain.Contains(m));
  struct Case {
    double Measurement::*parameter;
    double inside_min, inside_max, outside_below, outside_above;
  };
  for (const Case& c :
       {Case{&Measurement::camera_distance_m, 0.1, 0.8, 0.099, 0.801},
        Case{&Measurement::triangulation_angle_rad, -80 * kRadPerDeg, 80 * kRadPerDeg,
             -81 * kRadPerDeg, 81 * kRadPerDeg},
        Case{&Measurement::triangulation_angle_rad, -10 * kRadPerDeg, 10 * kRadPerDeg,
             -9 * kRadPerDeg, 9 * kRadPerDeg},
        Case{&Measurement::camera_polar_rad, 0, 90 * kRadPerDeg, -0.01, 91 * kRadPerDeg},
        Case{&Measurement::offset_y_m, -0.5, 0.5, -0.51, 0.51},
        Case{&Measurement::offset_z_m, -0.4, 0.4, -0.41, 0.41}}) {
    for (double value : {c.inside_min, c.inside_max}) {
      Measurement changed = m;
      changed.*c.parameter = value;
      EXPECT_TRUE(domain.Contains(changed)) << value;
    }
    for (double value : {c.outside_below, c.outside_above, std::nan("")}) {
      Measurement changed = m;
      changed.*c.parameter = value;
      EXPECT_FALSE(domain.Contains(changed)) << value;
    }
  }
  // Full turns: every angle is inside.
  for (double angle : {-10.0, 0.0, 3.0, 100.0}) {
    Measurement changed = m;
    changed.camera_azimuth_rad = changed.part_gamma_rad = angle;
    EXPECT_TRUE(domain.Contains(changed));
  }
}

TEST(MeasurementDomain, RangesAreSortedAndMerged) {
  const absl::StatusOr<Inspection> i = ParseFields(
      R"("measurement": {"camera_polar_deg": {"ranges": [
           {"min": 50, "max": 60}, {"min": 10, "max": 30}, {"min": 20, "max": 40}]}})");
  ASSERT_TRUE(i.ok());
  const auto& ranges = i->domain.parameters[3].ranges;
  ASSERT_EQ(ranges.size(), 2u);
  EXPECT_NEAR(ranges[0].min, 10 * kRadPerDeg, 1e-12);
  EXPECT_NEAR(ranges[0].max, 40 * kRadPerDeg, 1e-12);
  EXPECT_NEAR(ranges[1].min, 50 * kRadPerDeg, 1e-12);
  EXPECT_TRUE(i->domain.parameters[3].values.empty());
}

TEST(MeasurementDomain, FixedIsAListOfOne) {
  const absl::StatusOr<Inspection> i =
      ParseFields(R"("measurement": {"camera_distance_m": {"fixed": 0.4}})");
  ASSERT_TRUE(i.ok());
  EXPECT_EQ(i->domain.parameters[0].values, std::vector<double>{0.4});
  EXPECT_TRUE(i->domain.parameters[0].ranges.empty());
  EXPECT_TRUE(i->domain.parameters[0].Contains(0.4 + 1e-10));
  EXPECT_FALSE(i->domain.parameters[0].Contains(0.4 + 1e-8));
}

TEST(MeasurementDomain, PeriodicParametersWrapAround) {
  const absl::StatusOr<Inspection> i = ParseFields(
      R"("measurement": {"part_gamma_deg": {"ranges": [{"min": 350, "max": 360}, {"min": 0, "max": 10}]},
                         "camera_azimuth_deg": {"values": [0, 90]}})");
  ASSERT_TRUE(i.ok());
  const ParameterDomain& gamma = i->domain.parameters[6];
  for (double degrees : {-5.0, 5.0, 355.0, 365.0, 720.0}) {
    EXPECT_TRUE(gamma.Contains(degrees * kRadPerDeg)) << degrees;
  }
  for (double degrees : {-15.0, 15.0, 180.0, 345.0}) {
    EXPECT_FALSE(gamma.Contains(degrees * kRadPerDeg)) << degrees;
  }
  const ParameterDomain& azimuth = i->domain.parameters[2];
  EXPECT_TRUE(azimuth.Contains(360 * kRadPerDeg));
  EXPECT_TRUE(azimuth.Contains(-270 * kRadPerDeg));
  EXPECT_FALSE(azimuth.Contains(45 * kRadPerDeg));
}

TEST(MeasurementDomain, RestingOrientationsArePairs) {
  const absl::StatusOr<Inspection> i = ParseFields(
      R"("measurement": {"resting_orientations": [{}, {"part_alpha_deg": 180, "part_beta_deg": 90}]})");
  ASSERT_TRUE(i.ok());
  Measurement m;
  m.part_alpha_rad = 180 * kRadPerDeg;
  m.part_beta_rad = 90 * kRadPerDeg;
  EXPECT_TRUE(i->domain.Contains(m));
  m.part_beta_rad = 0;  // each is allowed, not together
  EXPECT_FALSE(i->domain.Contains(m));
  m.part_alpha_rad = 360 * kRadPerDeg;
  EXPECT_TRUE(i->domain.Contains(m));
}

// --- back to messages ---------------------------------------------------------------------------

TEST(InspectionToProto, WhatIsWrittenIsAccepted) {
  // At the ends of the ranges, where rounding of degrees could step outside.
  const absl::StatusOr<Inspection> i = ParseFields(
      R"("camera": {"columns_px": 16, "vertical_fov_deg": 169.99999999999997, "pixel_pitch_m": 1e-7},
         "laser": {"distance_m": 5, "fan_angle_deg": 179.99999999999997},
         "targets": {"max_normal_angle_deg": 90, "max_pixel_footprint_m": 1e-3,
                     "regions": [{"name": "bore", "min_m": {"x": -1, "y": -1, "z": -1},
                                  "max_m": {"x": 1, "y": 1, "z": 1}, "spacing_m": 0.001}]},
         "rig": {"scan_step_m": 1e-5, "camera_bodies": [
           {"centre_m": {"z": -0.1}, "cylinder": {"radius_m": 0.05, "length_m": 0.2}}]})");
  ASSERT_TRUE(i.ok()) << i.status();
  const v1::Camera camera = CameraToProto(i->rig.camera);
  const v1::Laser laser = LaserToProto(i->rig.laser);
  const v1::Rig rig = RigToProto(i->rig);
  const absl::StatusOr<Rig> again = ParseRig(rig, camera, nullptr, laser, "wire");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(RigToProto(*again).SerializeAsString(), rig.SerializeAsString());
  EXPECT_EQ(CameraToProto(again->camera).SerializeAsString(), camera.SerializeAsString());
  EXPECT_EQ(LaserToProto(again->laser).SerializeAsString(), laser.SerializeAsString());
  const v1::TargetSampling sampling = TargetSamplingToProto(i->targets);
  const absl::StatusOr<TargetSampling> targets = ParseTargetSampling(sampling, "wire");
  ASSERT_TRUE(targets.ok()) << targets.status();
  EXPECT_EQ(TargetSamplingToProto(*targets).SerializeAsString(), sampling.SerializeAsString());
}

TEST(InspectionToProto, DefaultsAreWrittenOut) {
  const v1::Rig rig = RigToProto(Rig());
  EXPECT_TRUE(rig.has_scan_step_m());
  EXPECT_EQ(rig.camera_bodies_size(), 1);
  EXPECT_EQ(CameraToProto(Camera()).vertical_fov_deg(), 45);
  EXPECT_EQ(TargetSamplingToProto(TargetSampling()).max_normal_angle_deg(), 30);
}

TEST(InspectionToProto, MeasurementsKeepTheirValue) {
  v1::Measurement message;
  message.set_camera_distance_m(0.4);
  message.set_triangulation_angle_deg(-30);
  message.set_camera_azimuth_deg(350);
  message.set_camera_polar_deg(15);
  message.set_part_alpha_deg(1);
  message.set_part_beta_deg(2);
  message.set_part_gamma_deg(3);
  message.set_offset_y_m(0.1);
  message.set_offset_z_m(-0.2);
  const Measurement m = MeasurementFromProto(message);
  EXPECT_NEAR(m.triangulation_angle_rad, -30 * kRadPerDeg, 1e-15);
  const auto back = ToArray(MeasurementFromProto(MeasurementToProto(m)));
  const auto original = ToArray(m);
  for (int i = 0; i < kMeasurementParameters; ++i) EXPECT_NEAR(back[i], original[i], 1e-14);
  EXPECT_NEAR(MeasurementToProto(m).camera_azimuth_deg(), 350, 1e-12);
}

// --- images -------------------------------------------------------------------------------------

constexpr char kSensor[] = R"("sensor": {"sensor_type": "mono", "pixel_pitch_m": 5e-6,
  "sensor_columns_px": 1000, "sensor_rows_px": 800, "bit_depth_bit": 10,
  "gain_dn_per_electron": 0.1, "quantum_efficiency": {"mono": 0.5},
  "saturation_capacity_electrons": 10000,
  "dark_mean_electrons": 10, "dark_noise_electrons": 5, "dark_current_electrons_per_s": 0})";

TEST(InspectionImaging, CameraFollowsSensorAndLens) {
  const auto parsed = ParseFields(
      absl::StrCat(R"("camera": {)", kSensor, R"(}, "lens": {"focal_length_m": 0.02, "f_number": 8,
          "focus_distance_m": 0.22})"));
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  const Camera& camera = parsed->rig.camera;
  EXPECT_EQ(camera.columns_px, 1000);
  EXPECT_EQ(camera.rows_px, 800);
  EXPECT_EQ(camera.pixel_pitch_m, 5e-6);
  // b = 1/(1/0.02 - 1/0.22) = 0.022 m.
  EXPECT_NEAR(camera.FocalLengthPx(), 0.022 / 5e-6, 1e-9);
  ASSERT_TRUE(parsed->sensor);
  EXPECT_EQ(parsed->sensor->gain_dn_per_electron, 0.1);
}

TEST(InspectionImaging, WithoutFocusTheFieldOfViewIsThatAtInfinity) {
  const auto parsed = ParseFields(absl::StrCat(
      R"("camera": {)", kSensor, R"(}, "lens": {"focal_length_m": 0.02, "f_number": 8})"));
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  EXPECT_NEAR(parsed->rig.camera.FocalLengthPx(), 0.02 / 5e-6, 1e-9);
  EXPECT_FALSE(parsed->rig.lens->focus_distance_m);
}

TEST(InspectionImaging, StatedFieldOfViewMustAgree) {
  const std::string lens = R"("lens": {"focal_length_m": 0.02, "f_number": 8})";
  // By sensor and lens 2 atan(0.002/0.02) = 11.42 degrees.
  const auto agrees =
      ParseFields(absl::StrCat(R"("camera": {"vertical_fov_deg": 12, )", kSensor, "}, ", lens));
  ASSERT_TRUE(agrees.ok()) << agrees.status();
  EXPECT_NEAR(agrees->rig.camera.vertical_fov_rad, 12 * kRadPerDeg, 1e-12);
  EXPECT_THAT(
      ErrorOfFields(absl::StrCat(R"("camera": {"vertical_fov_deg": 13, )", kSensor, "}, ", lens)),
      AllOf(HasSubstr("bracket.json: camera.vertical_fov_deg is 13"), HasSubstr("11.42")));
}

// Without a sensor the same numbers may stand in the camera: 1024 rows of 5.5 um behind 16 mm.
TEST(InspectionImaging, FieldOfViewFollowsFromPixelPitchAndLens) {
  const auto fields = [](const char* camera, const char* lens = "") {
    return absl::StrCat(R"("camera": {"rows_px": 1024, "pixel_pitch_m": 5.5e-6)", camera,
                        R"(}, "lens": {"focal_length_m": 0.016, "f_number": 8)", lens, "}");
  };
  const auto follows = ParseFields(fields(""));
  ASSERT_TRUE(follows.ok()) << follows.status();
  EXPECT_NEAR(follows->rig.camera.FocalLengthPx(), 0.016 / 5.5e-6, 1e-6);
  const auto focused = ParseFields(fields("", R"(, "focus_distance_m": 0.2)"));
  ASSERT_TRUE(focused.ok()) << focused.status();
  EXPECT_NEAR(focused->rig.camera.FocalLengthPx(), 1 / (1 / 0.016 - 1 / 0.2) / 5.5e-6, 1e-6);

  for (const char* agrees : {"19.96", "20", "18.5", "21.5"}) {
    const auto stated =
        ParseFields(fields(absl::StrCat(", \"vertical_fov_deg\": ", agrees).c_str()));
    EXPECT_TRUE(stated.ok()) << stated.status();
  }
  for (const char* differs : {"40", "10", "17.5", "22.5"}) {
    EXPECT_THAT(ErrorOfFields(fields(absl::StrCat(", \"vertical_fov_deg\": ", differs).c_str())),
                AllOf(HasSubstr(absl::StrCat("bracket.json: camera.vertical_fov_deg is ", differs)),
                      HasSubstr("1024 rows"), HasSubstr("0.016 m"), HasSubstr("19.964 deg")));
  }
  // Without a pitch or without a lens nothing follows.
  // Wide angles: 164 and 150 degrees differ by 9 %, their pixels on the part by a factor of 1.9.
  EXPECT_THAT(ErrorOfFields(
                  R"("camera": {"rows_px": 1024, "vertical_fov_deg": 164, "pixel_pitch_m": 7.29e-6},
                               "lens": {"focal_length_m": 0.001, "f_number": 8})"),
              HasSubstr("camera.vertical_fov_deg is 164"));
  EXPECT_NEAR(ParseFields(R"("camera": {"pixel_pitch_m": 5e-6})")->rig.camera.vertical_fov_rad,
              45 * kRadPerDeg, 1e-12);
  EXPECT_THAT(ErrorOfFields(R"("camera": {"rows_px": 16384, "pixel_pitch_m": 1e-3},
                               "lens": {"focal_length_m": 0.001, "f_number": 8})"),
              AllOf(HasSubstr("16384 rows"), HasSubstr("(0, 170) deg")));
}

TEST(InspectionImaging, DefaultsAndValues) {
  const auto parsed = ParseFields(R"("lens": {"focal_length_m": 0.016, "f_number": 11,
      "transmission": 0.9, "aperture_blades": 6, "obstruction_relative": 0.2,
      "zernike_m": [0, 0, 0, 1e-8], "distortion": {"k1": -0.1}},
    "laser": {"line_profile": "LINE_PROFILE_GAUSSIAN", "wavelength_m": 4.5e-7},
    "materials": [{"material": {"name": "grey", "lambert": {"diffuse_albedo": 0.4}}},
                  {"part_material": "steel", "material": {"conductor":
                    {"refractive_index_file": "nk/fe.csv"}}}],
    "lighting": {"ambient": {"radiance_w_m2_sr": 0.3}},
    "render": {"seed": 7, "speckle": false, "stage_speed_m_per_s": 0.05})");
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  EXPECT_EQ(parsed->rig.lens->transmission, 0.9);
  EXPECT_EQ(parsed->rig.lens->aperture_blades, 6);
  EXPECT_EQ(parsed->rig.lens->zernike_m.size(), 4u);
  EXPECT_EQ(parsed->rig.lens->distortion.k1, -0.1);
  EXPECT_EQ(parsed->rig.laser.line_profile, LineProfile::kGaussian);
  EXPECT_EQ(parsed->rig.laser.wavelength_m, 4.5e-7);
  EXPECT_EQ(parsed->rig.laser.power_w, 0.023);
  ASSERT_EQ(parsed->materials.size(), 2u);
  EXPECT_EQ(parsed->materials[1].material.conductor().refractive_index_file(), "parts/nk/fe.csv");
  EXPECT_EQ(parsed->lighting.ambient().radiance_w_m2_sr(), 0.3);
  EXPECT_EQ(parsed->render.seed, 7);
  EXPECT_FALSE(parsed->render.speckle);
  EXPECT_EQ(parsed->render.max_bounces, 4);
  EXPECT_EQ(parsed->render.exposure_time_s, 0.01);
  EXPECT_FALSE(parsed->sensor);
  EXPECT_EQ(parsed->rig.camera.columns_px, 512);
}

TEST(InspectionImaging, ErrorsNameFieldValueAndRange) {
  const struct {
    std::string fields, expected;
  } cases[] = {
      {R"("lens": {"focal_length_m": 0.016, "f_number": 8, "transmission": 0})",
       "lens.transmission is 0, must be in (0, 1]"},
      {R"("lens": {"focal_length_m": 0.016, "f_number": 8, "aperture_blades": 2})",
       "lens.aperture_blades is 2, must be in [3, 64]"},
      {R"("lens": {"focal_length_m": 0.016, "f_number": 8, "focus_distance_m": 0.016})",
       "lens.focus_distance_m is 0.016"},
      {R"("lens": {"focal_length_m": 0.016, "f_number": 8, "obstruction_relative": 1})",
       "lens.obstruction_relative is 1, must be in [0, 1)"},
      {R"("laser": {"beam_quality_m2": 0.5})", "laser.beam_quality_m2 is 0.5, must be in [1,"},
      {R"("laser": {"power_w": -1})", "laser.power_w is -1"},
      {R"("materials": [{"part_material": "a"}])", "materials[0] has neither file nor material"},
      {R"("materials": [{"material": {}}, {"material": {}}])",
       "materials[1].part_material is \"\""},
      {R"("lighting": {"ambient": {}})", "lighting.ambient.radiance_w_m2_sr is missing"},
      {R"("lighting": {"area_lights": [{"radiance_w_m2_sr": 1, "centre_m": {"z": 1},
          "half_edge_u_m": {"x": 1}, "half_edge_v_m": {"x": 1, "y": 1}}]})",
       "lighting.area_lights[0].half_edge_v_m is not perpendicular"},
      {R"("render": {"exposure_time_s": 0})", "render.exposure_time_s is 0, must be in (0, 100] s"},
      {R"("render": {"sub_pixels": 1})", "render.sub_pixels is 1, must be in [2, 64]"},
      {R"("effects": [{}])", "effects[0].effect is missing"},
      {R"("effects": [{"effect": "a"}, {"effect": "a"}])", "effects[1].effect is \"a\""},
      {absl::StrCat(R"("camera": {"columns_px": 1001, )", kSensor, "}"),
       "camera.columns_px is 1001, the sensor has only 1000"},
      {absl::StrCat(R"("camera": {"pixel_pitch_m": 4e-6, )", kSensor, "}"),
       "camera.pixel_pitch_m is 4e-06"},
      {absl::StrCat(R"("camera": {"sensor_file": "x.json", )", kSensor, "}"),
       "camera.sensor cannot be given together with camera.sensor_file"},
  };
  for (const auto& c : cases)
    EXPECT_THAT(ErrorOfFields(c.fields), HasSubstr("bracket.json: " + c.expected));
}

TEST(InspectionImaging, CameraAndMaterialFilesAreRead) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / "inspection_imaging";
  std::filesystem::create_directories(folder / "materials");
  std::ofstream(folder / "camera.json") << "{" << std::string(kSensor).substr(11);
  std::ofstream(folder / "materials" / "steel.json")
      << R"({"conductor": {"refractive_index_file": "fe.csv", "ggx_alpha_x": 0.2}})";
  v1::Inspection message;
  message.mutable_part()->set_file("a.glb");
  message.mutable_camera()->set_sensor_file("camera.json");
  message.add_materials()->set_file("materials/steel.json");
  const auto parsed = ParseInspection(message, "i.json", folder.string());
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  EXPECT_EQ(parsed->sensor->columns_px, 1000);
  EXPECT_EQ(parsed->materials[0].material.conductor().refractive_index_file(),
            (folder / "materials" / "fe.csv").string());
  EXPECT_EQ(parsed->materials[0].material.name(), "steel.json");

  // The camera's error names the camera's file; a missing file is not found.
  std::ofstream(folder / "camera.json") << R"({"sensor_type": "mono", "gain_dn_per_electron": 0})";
  EXPECT_THAT(std::string(ParseInspection(message, "i.json", folder.string()).status().message()),
              HasSubstr((folder / "camera.json").string()));
  message.mutable_camera()->set_sensor_file("none.json");
  EXPECT_EQ(ParseInspection(message, "i.json", folder.string()).status().code(),
            absl::StatusCode::kNotFound);
  std::filesystem::remove_all(folder);
}

TEST(InspectionImaging, EffectsKeepTheirParameters) {
  v1::Inspection message;
  message.mutable_part()->set_file("a.glb");
  v1::Effect* effect = message.add_effects();
  effect->set_effect("optics.veiling_glare");
  (*effect->mutable_parameters())["glare_fraction"] = 0.05;
  const auto parsed = ParseInspection(message, "i.json", "");
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  ASSERT_EQ(parsed->effects.size(), 1u);
  EXPECT_EQ(parsed->effects[0].id, "optics.veiling_glare");
  EXPECT_EQ(parsed->effects[0].parameters.at("glare_fraction"), 0.05);
}

// An inspection that was inlined once needs no files.
TEST(InspectionImaging, InliningIsIdempotent) {
  v1::Inspection message;
  message.mutable_part()->set_file("a.glb");
  v1::MaterialAssignment* assignment = message.add_materials();
  assignment->mutable_material()->mutable_merl()->set_file("m.binary");
  const auto once = InlineInspectionFiles(message, "i.json", "folder");
  ASSERT_TRUE(once.ok());
  const auto twice = InlineInspectionFiles(*once, "i.json", "");
  ASSERT_TRUE(twice.ok());
  EXPECT_EQ(once->SerializeAsString(), twice->SerializeAsString());
  EXPECT_EQ(once->materials(0).material().merl().file(), "folder/m.binary");
}

TEST(ParseRig, NaNOverTheWireIsRefused) {
  v1::Rig rig;
  rig.set_scan_step_m(std::nan(""));
  EXPECT_THAT(std::string(ParseRig(rig, {}, nullptr, {}, "spec").status().message()),
              HasSubstr("spec: rig.scan_step_m is NaN"));
}

}  // namespace
}  // namespace sightline
