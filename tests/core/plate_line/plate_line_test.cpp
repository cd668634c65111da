// SPDX-License-Identifier: Apache-2.0
#include "core/plate_line/plate_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace sightline {
namespace {

using std::numbers::pi;
using ::testing::HasSubstr;

TargetCamera CalibratedCamera() { return {.fx = 2000, .fy = 2000, .cx = 640, .cy = 512}; }

// Laser at the given angle from the camera's axis in the plane x = 0, whose plane contains the x
// axis and the point 0.3 m before the camera.
LaserSheet Sheet(double angle_rad) {
  const Eigen::Vector3d middle(0, 0, 0.3);
  const Eigen::Vector3d origin =
      middle + 0.4 * Eigen::Vector3d(0, std::sin(angle_rad), -std::cos(angle_rad));
  const Eigen::Vector3d normal = Eigen::Vector3d::UnitX().cross(origin - middle).normalized();
  return {normal, normal.dot(middle), origin};
}

Eigen::Isometry3d Plate(double about_x_rad, double about_y_rad = 0) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = (Eigen::AngleAxisd(about_x_rad, Eigen::Vector3d::UnitX()) *
                   Eigen::AngleAxisd(about_y_rad, Eigen::Vector3d::UnitY()))
                      .toRotationMatrix();
  pose.translation() = Eigen::Vector3d(0, 0, 0.3);
  return pose;
}

ObliqueView ViewAt(const LaserSheet& sheet, const Eigen::Isometry3d& plate) {
  const auto line = LineOnPlate(sheet, plate);
  EXPECT_TRUE(line.ok()) << line.status();
  const auto view = ViewOfLine(CalibratedCamera(), sheet, *line, false, {0, 0, 0.3});
  EXPECT_TRUE(view.ok()) << view.status();
  return *view;
}

TEST(PlateLine, PlatePerpendicularToTheAxisIsThatOfVersion1) {
  const ObliqueView view = ViewAt(Sheet(pi / 4), Plate(0));
  EXPECT_NEAR(view.incidence_angle_rad, pi / 4, 1e-9);
  EXPECT_NEAR(view.width_factor, 1, 1e-6);
  EXPECT_NEAR(view.view_cosine, 1, 1e-12);
  EXPECT_NEAR(view.half_normal_cosine, std::cos(pi / 8), 1e-9);
  EXPECT_NEAR(view.half_ray_cosine, std::cos(pi / 8), 1e-9);
}

TEST(PlateLine, WidthIsForeshortenedByTheView) {
  // A laser along the normal of a plate that the camera sees at 30 degrees: the line on the plate
  // is as wide as the beam, its image cos 30 degrees of that.
  const ObliqueView view = ViewAt(Sheet(pi / 6), Plate(pi / 6));
  EXPECT_NEAR(view.incidence_angle_rad, 0, 1e-6);
  EXPECT_NEAR(view.view_cosine, std::cos(pi / 6), 1e-9);
  EXPECT_NEAR(view.width_factor, std::cos(pi / 6), 1e-5);
  // Turned away from both: incidence 75 degrees, view 30 degrees. Width cos(view)/cos(incidence) of
  // the beam's; that of version 1 is 1/cos(incidence).
  const ObliqueView away = ViewAt(Sheet(pi / 4), Plate(-pi / 6));
  EXPECT_NEAR(away.incidence_angle_rad, pi / 4 + pi / 6, 1e-9);
  EXPECT_NEAR(away.width_factor, std::cos(pi / 6), 1e-5);
}

TEST(PlateLine, BrdfIsReciprocalAndOfVersion1AlongTheNormal) {
  ObliqueView view = ViewAt(Sheet(pi / 4), Plate(-pi / 9, 0.2));
  ObliqueView back = view;
  back.incidence_angle_rad = std::acos(view.view_cosine);
  back.view_cosine = std::cos(view.incidence_angle_rad);
  EXPECT_NEAR(ObliqueBrdf(0.3, 0.5, 0.3, view), ObliqueBrdf(0.3, 0.5, 0.3, back), 1e-12);
  EXPECT_NEAR(ObliqueBrdf(0.3, 0, 1, view), 0.3 / pi, 0.02);
}

TEST(PlateLine, PlacesLieOnPlateAndLaserPlaneAlsoWithDistortion) {
  TargetCamera camera = CalibratedCamera();
  camera.distortion = {-0.2, 0.05, 1e-3, -5e-4, 0};
  const LaserSheet sheet = Sheet(pi / 4);
  const Eigen::Isometry3d plate = Plate(0.3, -0.4);
  const auto line = LineOnPlate(sheet, plate);
  ASSERT_TRUE(line.ok());
  for (const double column : {50.0, 400.0, 640.0, 1200.0}) {
    const auto place = PlaceOfLine(camera, *line, false, column, {0, 0, 0.3});
    ASSERT_TRUE(place) << column;
    EXPECT_NEAR(place->image_px.x(), column, 1e-5);
    EXPECT_NEAR(sheet.normal.dot(place->point_m), sheet.offset_m, 1e-9);
    EXPECT_NEAR((plate.inverse() * place->point_m).z(), 0, 1e-9);
    EXPECT_NEAR((camera.Project(place->point_m) - place->image_px).norm(), 0, 1e-9);
  }
}

TEST(PlateLine, ErrorsSayWhatIsWrong) {
  const LaserSheet sheet = Sheet(pi / 4);
  Eigen::Isometry3d parallel = Plate(0);
  parallel.linear() =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), sheet.normal).toRotationMatrix();
  EXPECT_THAT(std::string(LineOnPlate(sheet, parallel).status().message()),
              HasSubstr("parallel to the laser plane"));
  Eigen::Isometry3d edge_on = Plate(0, pi / 2);
  EXPECT_THAT(std::string(LineOnPlate(sheet, edge_on).status().message()), HasSubstr("edge on"));
  // The laser stands on the other side of the plate.
  const auto line = LineOnPlate(sheet, Plate(-pi / 3));
  ASSERT_TRUE(line.ok());
  const auto view = ViewOfLine(CalibratedCamera(), sheet, *line, false, {0, 0, 0.3});
  EXPECT_THAT(std::string(view.status().message()), HasSubstr("from behind"));
}

}  // namespace
}  // namespace sightline
