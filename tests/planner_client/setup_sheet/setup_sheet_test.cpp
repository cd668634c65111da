// SPDX-License-Identifier: Apache-2.0
#include "planner_client/setup_sheet/setup_sheet.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/json/strict_json.h"
#include "planner_client/setup_sheet/direction_words.h"
#include "planner_client/setup_sheet/scene_drawing.h"
#include "tests/planner_client/exports/sample_plan.h"
#include "tests/report/report_reading.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

Eigen::Vector3d Direction(double polar_deg, double azimuth_deg) {
  const double polar = polar_deg * std::numbers::pi / 180;
  const double azimuth = azimuth_deg * std::numbers::pi / 180;
  return 0.4 * Eigen::Vector3d(std::sin(polar) * std::cos(azimuth),
                               std::sin(polar) * std::sin(azimuth), std::cos(polar));
}

TEST(PlaceInWords, NamesAxesAndTheAngleFromTheNearerOne) {
  EXPECT_EQ(PlaceInWords(Direction(0, 77)), "straight above");
  EXPECT_EQ(PlaceInWords(Direction(180, 0)), "straight below");
  EXPECT_EQ(PlaceInWords(Direction(38, 90)), "38\u00b0 from vertical, towards +y");
  EXPECT_EQ(PlaceInWords(Direction(38, 180)), "38\u00b0 from vertical, towards \u2212x");
  EXPECT_EQ(PlaceInWords(Direction(20, 25)), "20\u00b0 from vertical, 25\u00b0 from +x towards +y");
  EXPECT_EQ(PlaceInWords(Direction(20, 250)),
            "20\u00b0 from vertical, 20\u00b0 from \u2212y towards \u2212x");
  EXPECT_EQ(PlaceInWords(Direction(90, -90)), "level, towards \u2212y");
  EXPECT_EQ(PlaceInWords(Direction(105, 0)), "15\u00b0 below the horizontal, towards +x");
  EXPECT_EQ(PointsInWords(Direction(0, 0)), "up");
  EXPECT_EQ(PointsInWords(Direction(180, 0)), "down");
  EXPECT_EQ(PointsInWords(Direction(90, 0)), "towards +x");
  EXPECT_EQ(PointsInWords(Direction(70, 90)), "20\u00b0 above the horizontal, towards +y");
}

TEST(ConvexHull, IsTheOutermostPoints) {
  std::vector<Eigen::Vector2d> points;
  for (int x = 0; x <= 4; ++x) {
    for (int y = 0; y <= 3; ++y) points.emplace_back(x, y);
  }
  const std::vector<Eigen::Vector2d> hull = ConvexHull(points);
  ASSERT_EQ(hull.size(), 4u);
  double area = 0;
  for (size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d &a = hull[i], &b = hull[(i + 1) % 4];
    area += 0.5 * (a.x() * b.y() - a.y() * b.x());
  }
  EXPECT_DOUBLE_EQ(area, 12);  // counter-clockwise
  EXPECT_EQ(ConvexHull({{1, 2}}).size(), 1u);
  EXPECT_EQ(ConvexHull({{1, 2}, {1, 2}, {1, 2}}).size(), 1u);
}

// A box about the sample's centre.
SetUpSheet Sample() {
  SetUpSheet sheet;
  sheet.plan = SamplePlan();
  sheet.part_name = "bracket & co.stl";
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d half(corner & 1 ? 0.05 : -0.05, corner & 2 ? 0.03 : -0.03,
                               corner & 4 ? 0.02 : -0.02);
    sheet.mesh.positions_m.push_back((kSampleCentre_m + half).cast<float>());
  }
  sheet.pictures_png.resize(3);
  return sheet;
}

v1::Report Made(const SetUpSheet& sheet) {
  const auto report = SetUpReport(sheet);
  EXPECT_TRUE(report.ok()) << report.status();
  if (!report.ok()) return {};
  EXPECT_EQ(ReportFault(*report), "");
  return *report;
}

std::string TextOfSheet(const SetUpSheet& sheet) { return TextOf(Made(sheet)); }

TEST(SetUpSheet, HasAPageForEveryScan) {
  SetUpSheet sheet = Sample();
  sheet.pictures_png[0] = "\x89PNG";
  const v1::Report report = Made(sheet);
  EXPECT_THAT(TextOf(report), AllOf(HasSubstr("Scan 1 of 3"), HasSubstr("Scan 3 of 3"),
                                    HasSubstr("bracket & co.stl"), HasSubstr("<station>")));
  int pages = 0;
  for (const v1::ReportSection& section : report.sections()) pages += section.new_page();
  EXPECT_EQ(pages, 3);
  EXPECT_EQ(PicturesOf(report).size(), 1U);
  EXPECT_EQ(ToJson(report), ToJson(Made(sheet)));
}

TEST(SetUpSheet, HasAPageForEverySetUp) {
  SetUpSheet sheet = Sample();
  for (int s = 0; s < 2; ++s) {
    v1::Setup& setup = *sheet.plan.add_setups();
    setup.set_sensor_place(0);
    setup.mutable_time_s()->set_lay(180);
    setup.mutable_time_s()->set_total(240);
  }
  sheet.plan.mutable_setups(0)->add_scans(sheet.plan.scans(0).index());
  sheet.plan.mutable_setups(0)->add_scans(sheet.plan.scans(1).index());
  sheet.plan.mutable_setups(1)->add_scans(sheet.plan.scans(2).index());
  const v1::Report report = Made(sheet);
  EXPECT_THAT(TextOf(report), AllOf(HasSubstr("Set-up 1 of 2"), HasSubstr("Set-up 2 of 2"),
                                    HasSubstr("Put camera and laser in "), HasSubstr("place 1"),
                                    HasSubstr("Leave camera and laser where they are"),
                                    HasSubstr("4 min 00 s"), Not(HasSubstr("Scan 1 of 3"))));
  EXPECT_TRUE(SectionOf(report, "setup-2").sections(0).new_page());
  sheet.plan.mutable_setups(1)->add_scans(17);
  EXPECT_THAT(std::string(SetUpReport(sheet).status().message()),
              HasSubstr("a set-up names no scan"));
}

// The head of a sensor with camera and laser in one housing has one place; errors of placing are
// said as two standard deviations.
TEST(SetUpSheet, PlacesAHousingAsOneAndSaysHowExactly) {
  SetUpSheet sheet = Sample();
  v1::Setup& setup = *sheet.plan.add_setups();
  for (const v1::PlannedScan& scan : sheet.plan.scans()) setup.add_scans(scan.index());
  v1::Placement& placement = *sheet.plan.mutable_placement();
  placement.set_part_position_m(0.002);
  placement.set_part_angle_deg(1);
  placement.set_sensor_position_m(0.0005);
  placement.set_sensor_angle_deg(0.25);
  sheet.plan.mutable_coverage()->set_placement_p5(0.875);
  EXPECT_THAT(TextOfSheet(sheet),
              AllOf(HasSubstr("\u00b14.00 mm, \u00b12.00\u00b0"),
                    HasSubstr("\u00b11.00 mm, \u00b10.50\u00b0"), HasSubstr("87.5\u202f%"),
                    HasSubstr("Put camera and laser in "), Not(HasSubstr("Sensor head"))));
  sheet.one_housing = true;
  // The laser of the sample is 550 mm from the origin.
  EXPECT_THAT(TextOfSheet(sheet),
              AllOf(HasSubstr("Put the sensor head in "), HasSubstr("Stand-off"),
                    HasSubstr("550.0 mm"), Not(HasSubstr("Put camera and laser"))));
  sheet.face_pictures_png.resize(7);
  EXPECT_THAT(std::string(SetUpReport(sheet).status().message()),
              HasSubstr("7 pictures for 0 resting faces"));
}

TEST(SetUpSheet, ShowsNoTimesWithUnitCosts) {
  SetUpSheet sheet = Sample();
  v1::Setup& setup = *sheet.plan.add_setups();
  for (const v1::PlannedScan& scan : sheet.plan.scans()) setup.add_scans(scan.index());
  setup.mutable_time_s()->set_total(240);
  EXPECT_THAT(TextOfSheet(sheet), HasSubstr("4 min 00 s"));
  sheet.plan.mutable_cost()->set_unit_costs(true);
  EXPECT_THAT(TextOfSheet(sheet), AllOf(HasSubstr("Set-up 1 of 1"), Not(HasSubstr("4 min 00 s")),
                                        Not(HasSubstr("0.0 s"))));
}

// The first scan: camera straight above at 400 mm; the part is not turned, its centre at offset z.
TEST(SetUpSheet, SaysWhereThingsStand) {
  SetUpSheet sheet = Sample();
  sheet.plan.mutable_scans()->DeleteSubrange(1, 2);
  sheet.pictures_png.resize(1);
  const std::string text = TextOfSheet(sheet);
  EXPECT_THAT(text,
              AllOf(HasSubstr("straight above"), HasSubstr("0.0 / 0.0 / 400.0 mm"),
                    HasSubstr("0.0000 / 0.0000 / \u22121.0000"), HasSubstr("0.0 / 0.0 / 20.0")));
  // The laser 0.5 rad beside it, 550 mm away, towards -x.
  EXPECT_THAT(text, AllOf(HasSubstr("29\u00b0 from vertical, towards \u2212x"),
                          HasSubstr("\u2212263.7 / 0.0 / 482.7 mm")));
  EXPECT_THAT(text, AllOf(HasSubstr("\u221255.5 mm"), HasSubstr("47.5 mm"), HasSubstr("207"),
                          HasSubstr("0.5 mm")));
  // Lowest and highest point of the box.
  EXPECT_THAT(text, HasSubstr("0.0 / 40.0 mm"));
  EXPECT_THAT(text, AllOf(Not(HasSubstr("f-number")), Not(HasSubstr("Upper face of the table"))));
}

TEST(SetUpSheet, ShowsFacesSettingsQualityAndRemarksWhereThePlanHasThem) {
  SetUpSheet sheet = Sample();
  v1::RestingFace* face = sheet.plan.add_resting_faces();
  face->set_name("A");
  face->mutable_normal()->set_z(-1);
  face->set_stability_deg(31.4);
  v1::PlannedScan& scan = *sheet.plan.mutable_scans(1);
  scan.set_resting_face(0);
  scan.set_table_height_m(-0.0123);
  scan.set_locked(true);
  scan.add_remarks("the angle 85 \u00b0 > 80 \u00b0 is unusual");
  scan.mutable_setting()->set_f_number(5.6);
  scan.mutable_setting()->set_exposure_time_s(0.0021);
  scan.mutable_quality()->mutable_depth_per_pixel_m()->set_median(0.000345);
  scan.mutable_robot()->set_because("joint 3 would be at 4.1 rad");
  EXPECT_THAT(
      TextOfSheet(sheet),
      AllOf(HasSubstr("part lies on face A"), HasSubstr("31.4\u00b0"), HasSubstr("\u221212.3 mm"),
            HasSubstr("kept as given"), HasSubstr("85 \u00b0 > 80 \u00b0"), HasSubstr("5.6"),
            HasSubstr("2.10 ms"), HasSubstr("0.345 ("), HasSubstr("joint 3 would be at 4.1 rad")));
}

TEST(SetUpSheet, DrawingsStayInsideOfTheirFrames) {
  int drawings = 0;
  const v1::Report report = Made(Sample());
  for (const v1::ReportSection& section : report.sections()) {
    for (const v1::ReportBlock& block : section.blocks()) {
      for (const v1::ReportBlock& inner : block.group().blocks()) {
        if (!inner.has_drawing()) continue;
        ++drawings;
        const v1::ReportDrawing& drawing = inner.drawing();
        for (const v1::DrawnShape& shape : drawing.shapes()) {
          ASSERT_EQ(shape.x_size(), shape.y_size());
          for (int i = 0; i < shape.x_size(); ++i) {
            EXPECT_TRUE(shape.x(i) >= 0 && shape.x(i) <= drawing.width()) << shape.x(i);
            EXPECT_TRUE(shape.y(i) >= 0 && shape.y(i) <= drawing.height()) << shape.y(i);
          }
        }
      }
    }
  }
  EXPECT_EQ(drawings, 6);
}

// Texts of a drawing as boxes: half of a box is 3.5 units wide a letter and 7 high.
std::vector<Eigen::AlignedBox2d> TextBoxes(const v1::ReportDrawing& drawing) {
  std::vector<Eigen::AlignedBox2d> boxes;
  for (const v1::DrawnShape& shape : drawing.shapes()) {
    if (shape.kind() != v1::DrawnShape::TEXT) continue;
    const Eigen::Vector2d middle(shape.x(0), shape.y(0) - 5);
    const Eigen::Vector2d half(3.5 * static_cast<double>(shape.text().size()), 7);
    boxes.emplace_back(middle - half, middle + half);
  }
  return boxes;
}

TEST(SceneDrawing, TextsDoNotCoverEachOther) {
  const auto sensor = [](double angle_deg, double distance_m) {
    const double angle = angle_deg * std::numbers::pi / 180;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() << 0, 1, 0, 1, 0, 0, 0, 0, -1;
    pose.translation() = distance_m * Eigen::Vector3d(std::sin(angle), 0, std::cos(angle));
    return pose;
  };
  for (const double camera_deg : {-80., -30., -1., 0., 3., 45., 89.}) {
    for (const double between_deg : {-60., -10., 10., 35.}) {
      for (const double travel_m : {0., 0.02, 0.6}) {
        DrawnScene scene;
        scene.frames.camera = sensor(camera_deg, 0.4);
        scene.frames.laser = sensor(camera_deg + between_deg, 0.35);
        for (const double x : {-0.05, 0.05}) {
          for (const double y : {-0.03, 0.03}) {
            for (const double z : {-0.02, 0.}) scene.part_points_m.emplace_back(x, y, z);
          }
        }
        scene.centre_at_start_m.x() = -travel_m / 2;
        scene.centre_at_end_m.x() = travel_m / 2;
        for (const v1::ReportDrawing& drawing : {SideView(scene), TopView(scene)}) {
          const std::vector<Eigen::AlignedBox2d> boxes = TextBoxes(drawing);
          EXPECT_GE(boxes.size(), 5u);
          for (size_t i = 0; i < boxes.size(); ++i) {
            for (size_t j = 0; j < i; ++j) {
              EXPECT_TRUE(boxes[i].intersection(boxes[j]).isEmpty())
                  << "camera at " << camera_deg << ", laser " << between_deg
                  << " beside it, travel " << travel_m << ": texts " << i << " and " << j;
            }
          }
        }
      }
    }
  }
}

// Mean x of the points of all shapes of a kind and subject.
double MeanX(const v1::ReportDrawing& drawing, v1::DrawnShape::Kind kind,
             v1::DrawnShape::Subject subject) {
  double sum = 0;
  int count = 0;
  for (const v1::DrawnShape& shape : drawing.shapes()) {
    if (shape.kind() != kind || shape.subject() != subject) continue;
    for (const double x : shape.x()) sum += x;
    count += shape.x_size();
  }
  EXPECT_GT(count, 0);
  return sum / std::max(1, count);
}

// A sensor to the right of another is so in both drawings.
TEST(SceneDrawing, BothAreSeenFromTheSameSide) {
  for (const double azimuth_deg : {0., 40., 130., 180., 220., 320.}) {
    DrawnScene scene;
    const Eigen::AngleAxisd about_z(azimuth_deg * std::numbers::pi / 180, Eigen::Vector3d::UnitZ());
    for (Eigen::Isometry3d* pose : {&scene.frames.camera, &scene.frames.laser}) {
      pose->linear() << 0, 1, 0, 1, 0, 0, 0, 0, -1;
      pose->linear() = about_z * pose->linear();
    }
    scene.frames.camera.translation() = about_z * Eigen::Vector3d(0.3, 0, 0.3);
    scene.frames.laser.translation() = about_z * Eigen::Vector3d(-0.1, 0, 0.4);
    for (const double x : {-0.05, 0.05}) {
      for (const double y : {-0.03, 0.03}) scene.part_points_m.emplace_back(x, y, 0);
    }
    const v1::ReportDrawing side = SideView(scene), top = TopView(scene);
    const double in_side = MeanX(side, v1::DrawnShape::AREA, v1::DrawnShape::CAMERA) -
                           MeanX(side, v1::DrawnShape::AREA, v1::DrawnShape::LASER);
    const double in_top = MeanX(top, v1::DrawnShape::DOT, v1::DrawnShape::CAMERA) -
                          MeanX(top, v1::DrawnShape::DOT, v1::DrawnShape::LASER);
    EXPECT_GT(in_side * in_top, 0) << azimuth_deg;
  }
}

TEST(SetUpSheet, RefusesWhatDoesNotFit) {
  SetUpSheet sheet = Sample();
  sheet.pictures_png.pop_back();
  EXPECT_THAT(std::string(SetUpReport(sheet).status().message()),
              HasSubstr("2 pictures for 3 scans"));
  sheet = Sample();
  sheet.plan.mutable_scans(0)->set_resting_face(2);
  EXPECT_THAT(std::string(SetUpReport(sheet).status().message()),
              HasSubstr("scan 1: resting_face is 2, the plan has 0 faces"));
  sheet = Sample();
  sheet.mesh.positions_m.clear();
  EXPECT_FALSE(SetUpReport(sheet).ok());
  // No scans is a sheet of one page.
  sheet = Sample();
  sheet.plan.clear_scans();
  sheet.pictures_png.clear();
  EXPECT_THAT(TextOfSheet(sheet), HasSubstr("The plan has no scans"));
}

}  // namespace
}  // namespace sightline
