// SPDX-License-Identifier: Apache-2.0
#include "core/acceptance/acceptance_settings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/physics/angle.h"

namespace sightline {
namespace {

using testing::HasSubstr;

std::string ErrorOf(const v1::Acceptance& message) {
  return std::string(ParseAcceptance(message, "rig.json").status().message());
}

v1::Acceptance WithLimit(const std::string& quantity, double permitted_m) {
  v1::Acceptance message;
  message.add_limits()->set_quantity(quantity);
  message.mutable_limits(0)->set_permitted_m(permitted_m);
  return message;
}

Rig SmallRig() {
  Rig rig;
  rig.camera.columns_px = 640;
  rig.camera.rows_px = 480;
  rig.camera.vertical_fov_rad = 18 * kRadPerDeg;
  return rig;
}

Measurement SymmetricPlace() {
  Measurement place;
  place.camera_distance_m = 0.4;
  place.triangulation_angle_rad = 30 * kRadPerDeg;
  place.camera_polar_rad = 15 * kRadPerDeg;
  return place;
}

TEST(ParseAcceptance, TakesLimitsAndSizes) {
  v1::Acceptance message = WithLimit("probing_size_error", 2e-5);
  message.set_sphere_diameter_m(0.03);
  message.set_runs(50);
  const auto settings = ParseAcceptance(message, "rig.json");
  ASSERT_TRUE(settings.ok()) << settings.status();
  ASSERT_EQ(settings->limits.size(), 1U);
  EXPECT_EQ(settings->limits[0].kind, AcceptanceQuantityKind::kProbingSize);
  EXPECT_EQ(settings->limits[0].permitted_m, 2e-5);
  EXPECT_EQ(settings->sphere_diameter_m, 0.03);
  EXPECT_EQ(settings->runs, 50);
}

TEST(ParseAcceptance, NamesFieldAndReason) {
  EXPECT_THAT(ErrorOf(WithLimit("probing_size_eror", 1e-5)),
              testing::AllOf(HasSubstr("rig.json: acceptance.limits[0].quantity"),
                             HasSubstr("did you mean probing_size_error?")));
  EXPECT_THAT(ErrorOf(WithLimit("flatness_error_95", 0)),
              HasSubstr("acceptance.limits[0].permitted_m is 0, must be in (0, 1] m"));
  EXPECT_THAT(ErrorOf(WithLimit("", 1e-5)), HasSubstr("quantity is missing"));
  v1::Acceptance twice = WithLimit("flatness_error_95", 1e-5);
  *twice.add_limits() = twice.limits(0);
  EXPECT_THAT(ErrorOf(twice), HasSubstr("limits[1].quantity"));
  v1::Acceptance size;
  size.set_ring_diameter_m(-1);
  EXPECT_THAT(ErrorOf(size), HasSubstr("acceptance.ring_diameter_m is -1"));
  v1::Acceptance runs;
  runs.set_runs(3);
  EXPECT_THAT(ErrorOf(runs), HasSubstr("acceptance.runs is 3, must be in [20, 10000]"));
}

TEST(PlaceOfSensors, IsTheNearestThatTheDomainHas) {
  MeasurementDomain domain = ThesisDomain();
  const Measurement free = PlaceOfSensors({}, domain);
  EXPECT_NEAR(free.camera_distance_m, 0.4, 1e-12);
  EXPECT_NEAR(free.triangulation_angle_rad, 30 * kRadPerDeg, 1e-12);
  EXPECT_NEAR(free.camera_polar_rad, 15 * kRadPerDeg, 1e-12);
  domain.parameters[kCameraDistance] = {.ranges = {{0.5, 0.7}}, .values = {}};
  domain.parameters[kCameraPolar] = {.ranges = {}, .values = {20 * kRadPerDeg}};
  const Measurement bound = PlaceOfSensors({}, domain);
  EXPECT_NEAR(bound.camera_distance_m, 0.5, 1e-12);
  EXPECT_NEAR(bound.camera_polar_rad, 20 * kRadPerDeg, 1e-12);
}

TEST(ChooseArtefacts, FitsDefaultSizesIntoTheField) {
  const Rig rig = SmallRig();
  const ScanGeometry geometry = MakeScanGeometry(rig, SymmetricPlace());
  const auto choice = ChooseArtefacts({}, rig, geometry, {}, "rig.json");
  ASSERT_TRUE(choice.ok()) << choice.status();
  EXPECT_EQ(choice->artefacts.size(), 8U);  // sphere, four ball bars, plate, ring, pattern
  for (const Artefact& artefact : choice->artefacts) {
    EXPECT_TRUE(FitsIntoField(rig, geometry, artefact, {}).ok()) << artefact.name;
  }
}

TEST(ChooseArtefacts, NamesAnArtefactThatIsTooLarge) {
  const Rig rig = SmallRig();
  const ScanGeometry geometry = MakeScanGeometry(rig, SymmetricPlace());
  AcceptanceSettings settings;
  settings.plate_side_m = 0.5;
  const auto choice = ChooseArtefacts(settings, rig, geometry, {}, "rig.json");
  EXPECT_THAT(std::string(choice.status().message()),
              testing::AllOf(HasSubstr("rig.json: acceptance.plate_side_m is 0.5 m"),
                             HasSubstr("the flat plate does not fit into the field"),
                             HasSubstr("camera's field of view")));
}

TEST(ChooseArtefacts, RefusesASheetAlongTheStage) {
  const Rig rig = SmallRig();
  Measurement place = SymmetricPlace();
  place.camera_azimuth_rad = 90 * kRadPerDeg;
  const auto choice = ChooseArtefacts({}, rig, MakeScanGeometry(rig, place), {}, "rig.json");
  EXPECT_THAT(std::string(choice.status().message()), HasSubstr("camera_azimuth_deg"));
}

}  // namespace
}  // namespace sightline
