// SPDX-License-Identifier: Apache-2.0
#include "core/inspection/part_holding.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_format.h"
#include "core/json/strict_json.h"
#include "core/part/load_part.h"
#include "core/part/part_digest.h"
#include "core/physics/angle.h"
#include "core/rig/scan_geometry.h"
#include "tests/core/inspection/parse_fields.h"
#include "tests/core/part/test_meshes.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(PartHolding, AnInspectionThatSaysNothingRests) {
  EXPECT_EQ(ParseFields("")->part_holding, PartHolding::kResting);
  EXPECT_EQ(ParseFields(R"("measurement": {"resting_orientations": [{"part_alpha_deg": 90}]})")
                ->part_holding,
            PartHolding::kResting);
  EXPECT_EQ(ParseFields(R"("measurement": {"part_beta_deg": {"fixed": 0}})")->part_holding,
            PartHolding::kFree);
}

TEST(PartHolding, AFixtureHoldsThePartAsTheFileHasIt) {
  const auto inspection = ParseFields(R"("rig": {"part_holding": "PART_HOLDING_FIXTURE"})");
  ASSERT_TRUE(inspection.ok()) << inspection.status();
  Measurement m;
  EXPECT_TRUE(inspection->domain.Contains(m));
  m.part_gamma_rad = 1;
  EXPECT_TRUE(inspection->domain.Contains(m));
  m.part_alpha_rad = 0.1;
  EXPECT_FALSE(inspection->domain.Contains(m));
}

TEST(PartHolding, WhatExcludesEachOtherIsNamed) {
  EXPECT_THAT(ErrorOfFields(R"("rig": {"part_holding": "PART_HOLDING_RESTING"},
                         "measurement": {"part_alpha_deg": {"fixed": 0}})"),
              AllOf(HasSubstr("measurement.part_alpha_deg"), HasSubstr("PART_HOLDING_RESTING")));
  EXPECT_THAT(ErrorOfFields(R"("rig": {"part_holding": "PART_HOLDING_FIXTURE"},
                         "measurement": {"resting_orientations": [{}]})"),
              HasSubstr("measurement.resting_orientations"));
  EXPECT_THAT(ErrorOfFields(R"("rig": {"part_holding": "PART_HOLDING_FREE", "table": {}})"),
              HasSubstr("rig.table"));
  EXPECT_THAT(ErrorOfFields(R"("rig": {"table": {"thickness_m": 0}})"),
              AllOf(HasSubstr("rig.table.thickness_m"), HasSubstr("[0.001, 1] m")));
}

// A box of 20 x 20 x 120 mm topples at atan(20 / 120) = 9.5 degrees from its ends.
TEST(PartHolding, FacesThatToppleEasilyAreNotOffered) {
  const TriangleMesh bar = BoxMesh({0, 0, 0}, {0.02f, 0.02f, 0.12f});
  auto inspection = ParseFields("");
  const auto held = HoldPart(bar, &*inspection);
  ASSERT_TRUE(held.ok()) << held.status();
  EXPECT_EQ(held->faces.size(), 4u);
  ASSERT_EQ(held->excluded.size(), 2u);
  EXPECT_THAT(held->excluded[0].because, AllOf(HasSubstr("topples at 9 deg"), HasSubstr("15 deg")));
  EXPECT_EQ(inspection->domain.resting_orientations.size(), 4u);
  auto before = ParseFields(R"("defaults": "0.1")");
  const auto all = HoldPart(bar, &*before);
  ASSERT_TRUE(all.ok());
  EXPECT_EQ(all->faces.size(), 6u);
  EXPECT_TRUE(all->excluded.empty());
}

TEST(PartHolding, FacesOnWhichAClampStandsInTheTableAreExcluded) {
  const TriangleMesh part = BoxMesh({0, 0, 0}, {0.06f, 0.04f, 0.02f});
  // Beside the part, 35 mm below its lower face.
  const TriangleMesh clamp = BoxMesh({0.06f, 0, -0.035f}, {0.07f, 0.04f, 0.01f});
  auto inspection = ParseFields("");
  auto held = HoldPart(part, &*inspection);
  ASSERT_TRUE(held.ok());
  const size_t faces = held->faces.size();
  const absl::Status left =
      ExcludeBlockedRests(part, {{&clamp, ObstacleFrame::kPart, "clamp"}}, &*inspection, &*held);
  ASSERT_TRUE(left.ok()) << left;
  EXPECT_EQ(held->faces.size(), inspection->domain.resting_orientations.size());
  // On the lower face, and on the side that the clamp stands at.
  EXPECT_EQ(held->excluded.size(), 2u);
  EXPECT_EQ(held->faces.size() + held->excluded.size(), faces);
  bool below = false;
  for (const ExcludedRest& excluded : held->excluded) {
    if (excluded.face.normal.z() > -0.9) continue;
    below = true;
    EXPECT_EQ(excluded.obstacle, "clamp");
    EXPECT_THAT(excluded.because, HasSubstr("35 mm"));
  }
  EXPECT_TRUE(below);
  for (const RestingFace& face : held->faces) EXPECT_GT(face.normal.z(), -0.9);
}

// Servers know a mesh by the digest of what they read.
TEST(PartHolding, TheTableIsTheSameWhenItIsReadAgain) {
  auto inspection = ParseFields("");
  const auto held = HoldPart(BoxMesh({0, 0, 0}, {0.06f, 0.04f, 0.02f}), &*inspection);
  ASSERT_TRUE(held.ok() && held->table) << held.status();
  std::string text;
  for (const Eigen::Vector3f& p : held->table->positions_m) {
    absl::StrAppendFormat(&text, "v %.9g %.9g %.9g\n", p.x(), p.y(), p.z());
  }
  for (const auto& t : held->table->triangles) {
    absl::StrAppendFormat(&text, "f %d %d %d\n", t[0] + 1, t[1] + 1, t[2] + 1);
  }
  const auto read = LoadPartFromMemory(text, "obj", "m", "table");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(PartDigestOf(*read), PartDigestOf(*held->table));
}

TEST(PartHolding, ThePartsFacesBecomeTheDomain) {
  auto inspection = ParseFields("");
  const TriangleMesh part = BoxMesh({0, 0, 0}, {0.06f, 0.04f, 0.02f});
  const auto held = HoldPart(part, &*inspection);
  ASSERT_TRUE(held.ok()) << held.status();
  ASSERT_EQ(held->faces.size(), 6u);
  ASSERT_EQ(inspection->domain.resting_orientations.size(), 6u);
  EXPECT_EQ(inspection->domain.resting_orientations[0].name, "A");
  // One table for all orientations, under the part in each.
  ASSERT_TRUE(held->table);
  const Eigen::AlignedBox3d table = held->table->BoundingBox();
  EXPECT_EQ(table.max().z(), 0);
  EXPECT_NEAR(table.min().z(), -0.02, 1e-8);
  EXPECT_NEAR(table.sizes().x(),
              BoxMesh({0, 0, 0}, {0.06f, 0.04f, 0.02f}).BoundingBox().diagonal().norm() + 0.2,
              1e-6);
  const double half_heights_m[] = {0.01, 0.01, 0.02, 0.02, 0.03, 0.03};
  for (size_t i = 0; i < 6; ++i) {
    Measurement m;
    m.part_alpha_rad = held->faces[i].part_alpha_rad;
    m.part_beta_rad = held->faces[i].part_beta_rad;
    m.part_gamma_rad = 0.3 * static_cast<double>(i);
    EXPECT_NEAR(MakeScanGeometry(inspection->rig, m).table_height_m, -half_heights_m[i], 1e-6);
  }
}

TEST(PartHolding, GivenOrientationsStayAndGetNames) {
  auto inspection = ParseFields(R"("rig": {"table": {"size_x_m": 0.3}},
      "measurement": {"resting_orientations": [{"name": "B"}, {"part_alpha_deg": 90}]})");
  ASSERT_TRUE(inspection.ok()) << inspection.status();
  const auto held = HoldPart(BoxMesh({0, 0, 0}, {0.06f, 0.04f, 0.02f}), &*inspection);
  ASSERT_TRUE(held.ok()) << held.status();
  ASSERT_EQ(held->faces.size(), 2u);
  EXPECT_EQ(held->faces[0].name, "B");
  EXPECT_EQ(held->faces[1].name, "C");
  EXPECT_NEAR(held->faces[1].normal.y(), -1, 1e-9);
  EXPECT_NEAR(held->table->BoundingBox().sizes().x(), 0.3, 1e-7);
}

TEST(PartHolding, AFlatOrRoundPartNeedsAnotherHolding) {
  auto inspection = ParseFields("");
  const auto flat = HoldPart(PlateMesh(0.1, 0.1, 2, 2), &*inspection);
  EXPECT_THAT(
      std::string(flat.status().message()),
      AllOf(HasSubstr("parts/a.glb"), HasSubstr("flat"), HasSubstr("PART_HOLDING_FIXTURE")));
  const auto ball = HoldPart(SphereMesh(0.05, 3), &*inspection);
  EXPECT_THAT(std::string(ball.status().message()), HasSubstr("resting_orientations"));
}

TEST(PartHolding, ObstaclesThatCutAreNamedWithTheirVolume) {
  const TriangleMesh part = BoxMesh({0, 0, 0}, {0.06f, 0.04f, 0.02f});
  const auto check = [&](const std::string& fields, const TriangleMesh& obstacle,
                         ObstacleFrame frame) {
    auto inspection = ParseFields(fields);
    EXPECT_TRUE(inspection.ok()) << inspection.status();
    const auto held = HoldPart(part, &*inspection);
    EXPECT_TRUE(held.ok()) << held.status();
    return std::string(
        CheckObstaclesClear(part, *inspection, *held, {{&obstacle, frame, "plate"}}).message());
  };
  // A table whose upper face is where the documentation once had it: at the centre of the part.
  const TriangleMesh plate = BoxMesh({-0.2f, -0.2f, -0.05f}, {0.2f, 0.2f, 0});
  EXPECT_THAT(check("", plate, ObstacleFrame::kStage),
              AllOf(HasSubstr("obstacles[0] \"plate\" cuts into the part"), HasSubstr("24 cm3"),
                    HasSubstr("10.0 mm deep"), HasSubstr("face A")));
  EXPECT_EQ(check("", plate, ObstacleFrame::kTable), "");
  EXPECT_EQ(check("", plate, ObstacleFrame::kWorld), "");
  EXPECT_THAT(check("", plate, ObstacleFrame::kPart), "");  // touches the face it stands on
  EXPECT_THAT(
      check("", BoxMesh({0.01f, 0.01f, 0.01f}, {0.02f, 0.02f, 0.05f}), ObstacleFrame::kPart),
      HasSubstr("1 cm3"));
  // Beside the part: in the way in some turns only, which the scans' collision check sees.
  EXPECT_EQ(
      check("", BoxMesh({0.025f, -0.01f, 0.0f}, {0.04f, 0.01f, 0.05f}), ObstacleFrame::kTable), "");
  EXPECT_THAT(check(R"("measurement": {"part_gamma_deg": {"fixed": 0}})",
                    BoxMesh({0.025f, -0.01f, 0.0f}, {0.04f, 0.01f, 0.05f}), ObstacleFrame::kTable),
              HasSubstr("cuts into the part"));
  EXPECT_THAT(
      check(R"("rig": {"part_holding": "PART_HOLDING_FIXTURE"})", plate, ObstacleFrame::kStage),
      HasSubstr("cuts into the part"));
}

TEST(DeriveLimits, FollowTheRequiredResolutionWhereNotGiven) {
  auto plain = ParseFields("");
  DeriveLimits(&*plain);
  EXPECT_EQ(plain->targets.max_pixel_footprint_m, 0.0015);
  EXPECT_EQ(plain->targets.max_depth_per_pixel_m, 0.003);
  auto fine =
      ParseFields(R"("targets": {"required_resolution_m": 0.001, "max_depth_per_pixel_m": 0.01})");
  DeriveLimits(&*fine);
  EXPECT_EQ(fine->targets.max_pixel_footprint_m, 0.0005);
  EXPECT_EQ(fine->targets.max_depth_per_pixel_m, 0.01);
  auto none = ParseFields(R"("targets": {"required_resolution_m": 0})");
  DeriveLimits(&*none);
  EXPECT_FALSE(none->targets.max_pixel_footprint_m);
  EXPECT_FALSE(none->targets.max_depth_per_pixel_m);
  auto uncertain = ParseFields(R"("uncertainty": {}, "tolerances": {"zone_width_m": 0.001},
                            "goal": {"admissible": 0.8})");
  ASSERT_TRUE(uncertain.ok()) << uncertain.status();
  DeriveLimits(&*uncertain);
  EXPECT_FALSE(uncertain->targets.max_depth_per_pixel_m);
  EXPECT_THAT(ErrorOfFields(R"("targets": {"required_resolution_m": -1})"),
              HasSubstr("targets.required_resolution_m"));
}

std::pair<double, double> LargestOffsets(const Inspection& inspection) {
  const auto largest = [&](int parameter) {
    const auto& ranges = inspection.domain.parameters[parameter].ranges;
    EXPECT_EQ(ranges.size(), 1u);
    EXPECT_EQ(ranges.at(0).min, -ranges.at(0).max);
    return ranges.at(0).max;
  };
  return {largest(kOffsetY), largest(kOffsetZ)};
}

// 30 x 20 x 12 mm has a diagonal of 38 mm.
TriangleMesh SmallPart() { return BoxMesh({0, 0, 0}, {0.03f, 0.02f, 0.012f}); }

TEST(Offsets, FollowThePartsSizeWhereNotGiven) {
  for (const std::string holding : {"RESTING", "FIXTURE", "FREE"}) {
    auto small = ParseFields(R"("rig": {"part_holding": "PART_HOLDING_)" + holding + "\"}");
    ASSERT_TRUE(small.ok() && HoldPart(SmallPart(), &*small).ok());
    EXPECT_EQ(LargestOffsets(*small), std::pair(0.04, 0.04)) << holding;
  }
  auto middle = ParseFields("");
  ASSERT_TRUE(HoldPart(BoxMesh({0, 0, 0}, {0.4f, 0.2f, 0.05f}), &*middle).ok());
  EXPECT_EQ(LargestOffsets(*middle), std::pair(0.45, 0.4));
  auto large = ParseFields("");
  ASSERT_TRUE(HoldPart(BoxMesh({0, 0, 0}, {0.45f, 0.28f, 0.1f}), &*large).ok());
  EXPECT_EQ(LargestOffsets(*large), std::pair(0.5, 0.4));  // Table 2.1
}

TEST(Offsets, ThatAreGivenStay) {
  auto given =
      ParseFields(R"("measurement": {"offset_y_m": {"ranges": [{"min": -0.5, "max": 0.5}]}})");
  ASSERT_TRUE(given.ok() && HoldPart(SmallPart(), &*given).ok());
  EXPECT_EQ(LargestOffsets(*given), std::pair(0.5, 0.04));
  auto fixed = ParseFields(R"("measurement": {"offset_z_m": {"fixed": 0.3}})");
  ASSERT_TRUE(fixed.ok() && HoldPart(SmallPart(), &*fixed).ok());
  EXPECT_EQ(fixed->domain.parameters[kOffsetZ].values, std::vector<double>{0.3});
  EXPECT_TRUE(fixed->domain.parameters[kOffsetZ].ranges.empty());
}

TEST(MeasurementDomain, GoesOverTheWireAndBack) {
  const auto inspection = ParseFields(
      R"("measurement": {"camera_distance_m": {"ranges": [{"min": 0.2, "max": 0.5}]},
         "triangulation_angle_deg": {"values": [-30, 30]}, "part_gamma_deg": {"fixed": 12.5},
         "resting_orientations": [{"part_alpha_deg": 89.7, "name": "x"}]})");
  ASSERT_TRUE(inspection.ok()) << inspection.status();
  const v1::MeasurementDomain message = MeasurementDomainToProto(inspection->domain);
  const auto back = ParseMeasurementDomain(message, "spec");
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(MeasurementDomainToProto(*back).SerializeAsString(), message.SerializeAsString());
  EXPECT_EQ(back->resting_orientations.at(0).name, "x");
  EXPECT_NEAR(back->resting_orientations.at(0).part_alpha_rad, 89.7 * kRadPerDeg, 1e-12);
  EXPECT_EQ(back->parameters[0].ranges.at(0).max, 0.5);
  EXPECT_EQ(back->parameters[6].values.size(), 1u);
}

}  // namespace
}  // namespace sightline
