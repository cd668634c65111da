// SPDX-License-Identifier: Apache-2.0
// Why targets are not covered: parts made so that one condition fails, exact evaluation of the
// scans that are said to measure a target, and Embree as the judge of what is hidden.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>

#include "core/physics/angle.h"
#include "coverage_server/explanation/aimed_scan.h"
#include "coverage_server/explanation/explain_targets.h"
#include "coverage_server/scene/coverage_scene.h"
#include "tests/core/part/test_meshes.h"
#include "tests/coverage_server/reference/embree_judge.h"
#include "tests/coverage_server/test_parts.h"

namespace sightline {
namespace {

ParameterDomain Fixed(double value) { return {.ranges = {}, .values = {value}}; }
ParameterDomain Between(double min, double max) { return {.ranges = {{min, max}}, .values = {}}; }

// Lies as in the file; camera from above, laser beside it.
MeasurementDomain FromAbove() {
  MeasurementDomain domain = ThesisDomain();
  domain.resting_orientations = {{0, 0}};
  domain.parameters[1] = Between(15 * kRadPerDeg, 40 * kRadPerDeg);
  domain.parameters[3] = Between(0, 40 * kRadPerDeg);
  return domain;
}

// A cube of 40 mm about the origin.
SceneDefinition Cube() {
  SceneDefinition definition;
  definition.part = BoxMesh({-0.02f, -0.02f, -0.02f}, {0.02f, 0.02f, 0.02f});
  definition.sampling.spacing_m = 0.008;
  definition.field_directions = 64;
  return definition;
}

std::vector<uint32_t> TargetsFacing(const CoverageScene& scene, const Eigen::Vector3f& direction) {
  std::vector<uint32_t> targets;
  for (size_t t = 0; t < scene.targets().size(); ++t) {
    if (scene.targets().normals[t].dot(direction) > 0.9f) {
      targets.push_back(static_cast<uint32_t>(t));
    }
  }
  return targets;
}

std::vector<TargetExplanation> Explain(const CoverageScene& scene, const MeasurementDomain& domain,
                                       const std::vector<uint32_t>& targets) {
  std::vector<TargetExplanation> explanations(targets.size());
  scene.Explain(domain, targets, explanations, nullptr);
  return explanations;
}

void ExpectReason(const SceneDefinition& definition, const MeasurementDomain& domain,
                  const Eigen::Vector3f& facing, UncoveredReason reason, int obstacle = -1) {
  const auto scene = BuildScene(definition, 1);
  ASSERT_NE(scene, nullptr);
  const std::vector<uint32_t> targets = TargetsFacing(*scene, facing);
  ASSERT_GT(targets.size(), 10u);
  for (const TargetExplanation& explanation : Explain(*scene, domain, targets)) {
    EXPECT_EQ(static_cast<int>(explanation.reason), static_cast<int>(reason));
    EXPECT_EQ(explanation.obstacle, obstacle);
    EXPECT_GE(explanation.tried_scans, 1);
    EXPECT_LE(explanation.scans_with_reason, explanation.tried_scans);
    EXPECT_EQ(explanation.scans_with_reason > 0, reason != UncoveredReason::kNotChosen);
  }
}

const Eigen::Vector3f kUp(0, 0, 1), kDown(0, 0, -1);

TEST(Explanation, OpenSurfaceIsNotChosen) {
  ExpectReason(Cube(), ThesisDomain(), kUp, UncoveredReason::kNotChosen);
  ExpectReason(Cube(), FromAbove(), kUp, UncoveredReason::kNotChosen);
}

TEST(Explanation, UndersideFacesAway) {
  ExpectReason(Cube(), FromAbove(), kDown, UncoveredReason::kAngle);
}

TEST(Explanation, ClosedCavityIsHiddenByThePart) {
  SceneDefinition definition = Cube();
  definition.part =
      Merged(definition.part, Flipped(BoxMesh({-0.01f, -0.01f, -0.01f}, {0.01f, 0.01f, 0.01f})));
  definition.sampling.spacing_m = 0.002;
  const auto scene = BuildScene(definition, 1);
  ASSERT_NE(scene, nullptr);
  std::vector<uint32_t> inside;
  for (size_t t = 0; t < scene->targets().size(); ++t) {
    if (scene->targets().positions_m[t].cwiseAbs().maxCoeff() < 0.011f)
      inside.push_back(static_cast<uint32_t>(t));
  }
  ASSERT_GT(inside.size(), 100u);
  for (const TargetExplanation& explanation : Explain(*scene, ThesisDomain(), inside)) {
    EXPECT_EQ(static_cast<int>(explanation.reason),
              static_cast<int>(UncoveredReason::kOwnOcclusion));
  }
}

TEST(Explanation, ObstacleIsNamedInEveryFrame) {
  // Plates 5 mm over the top of the cube, which rests in the middle of the rig, so wide that no
  // scan along the laser line gets beside one; the first obstacle is out of the way. Sheets nearly
  // along the travel light the cube far away from a plate that stands still, outside the image.
  SceneDefinition definition = Cube();
  MeasurementDomain domain = FromAbove();
  domain.parameters[7] = domain.parameters[8] = Fixed(0);
  const SceneObstacle aside{BoxMesh({1, 1, 1}, {1.01f, 1.01f, 1.01f}), ObstacleFrame::kWorld};
  for (const auto frame : {ObstacleFrame::kPart, ObstacleFrame::kStage, ObstacleFrame::kWorld}) {
    const SceneObstacle plate{BoxMesh({-0.5f, -0.5f, 0.025f}, {0.5f, 0.5f, 0.026f}), frame};
    definition.obstacles = {aside, plate};
    SCOPED_TRACE(testing::Message() << "frame " << static_cast<int>(frame));
    ExpectReason(definition, domain, kUp, UncoveredReason::kObstacle, 1);
  }
}

TEST(Explanation, CoarsePixels) {
  SceneDefinition definition = Cube();
  // At the nearest distance, 100 mm, a pixel covers 162 um.
  definition.sampling.max_pixel_footprint_m = 50e-6;
  ExpectReason(definition, FromAbove(), kUp, UncoveredReason::kFootprint);
}

TEST(Explanation, OutOfFocus) {
  SceneDefinition definition = Cube();
  definition.rig.camera.pixel_pitch_m = 5e-6;
  definition.rig.lens.emplace();
  definition.rig.lens->f_number = 2;
  definition.rig.lens->focus_distance_m = 0.8;
  definition.sampling.max_circle_of_confusion_px = 1;
  MeasurementDomain domain = FromAbove();
  domain.parameters[0] = Fixed(0.3);
  ExpectReason(definition, domain, kUp, UncoveredReason::kDefocus);
}

TEST(Explanation, OutsideTheImage) {
  MeasurementDomain domain = FromAbove();
  domain.parameters[0] = Fixed(0.2);
  domain.parameters[2] = Fixed(0);
  domain.parameters[7] = Fixed(0.4);
  ExpectReason(Cube(), domain, kUp, UncoveredReason::kRange);
}

TEST(Explanation, Collision) {
  SceneDefinition definition = Cube();
  MeasurementDomain domain = FromAbove();
  domain.parameters[0] = Fixed(0.4);
  domain.parameters[3] = Fixed(0);
  // A slab where the camera's body is, behind its pupil.
  const SceneObstacle slab = {BoxMesh({-0.1f, -0.1f, 0.44f}, {0.1f, 0.1f, 0.46f}),
                              ObstacleFrame::kWorld};
  const SceneObstacle aside = {BoxMesh({1, 1, 1}, {1.01f, 1.01f, 1.01f}), ObstacleFrame::kStage};
  definition.obstacles = {slab};
  ExpectReason(definition, domain, kUp, UncoveredReason::kCollision, 0);
  definition.obstacles = {aside, slab};
  ExpectReason(definition, domain, kUp, UncoveredReason::kCollision, 1);
}

TEST(Explanation, CollisionWithThePartNamesNoObstacle) {
  SceneDefinition definition = Cube();
  // Bodies hide nothing: the camera looks through its box, which no offset of the cube avoids.
  definition.rig.camera_bodies = {BoxBody{{0, 0, 0.5}, {2, 2, 0.9}}};
  MeasurementDomain domain = FromAbove();
  domain.parameters[0] = Fixed(0.2);
  domain.parameters[3] = Fixed(0);
  definition.obstacles = {{BoxMesh({1, 1, 1}, {1.01f, 1.01f, 1.01f}), ObstacleFrame::kWorld}};
  ExpectReason(definition, domain, kUp, UncoveredReason::kCollision);
}

TEST(Explanation, CameraAndLaserInTheSamePlaceNameNoObstacle) {
  SceneDefinition definition = Cube();
  MeasurementDomain domain = FromAbove();
  domain.parameters[0] = Fixed(0.15);
  domain.parameters[1] = Between(10 * kRadPerDeg, 15 * kRadPerDeg);
  definition.obstacles = {{BoxMesh({1, 1, 1}, {1.01f, 1.01f, 1.01f}), ObstacleFrame::kWorld}};
  ExpectReason(definition, domain, kUp, UncoveredReason::kCollision);
}

TEST(Explanation, TooLittleTravel) {
  SceneDefinition definition = Cube();
  definition.rig.stage_travel_m = 0.002;
  MeasurementDomain domain = FromAbove();
  domain.parameters[0] = Between(0.4, 0.8);
  ExpectReason(definition, domain, kUp, UncoveredReason::kTravel);
}

TEST(Explanation, SameForAnySplit) {
  SceneDefinition definition = Cube();
  definition.part = BlindHolePart();
  const auto scene = BuildScene(definition, 1);
  ASSERT_NE(scene, nullptr);
  std::vector<uint32_t> all;
  for (size_t t = 0; t < scene->targets().size(); t += 3) all.push_back(static_cast<uint32_t>(t));
  const auto together = Explain(*scene, FromAbove(), all);
  for (size_t i = 0; i < all.size(); ++i) {
    const TargetExplanation alone = Explain(*scene, FromAbove(), {all[i]})[0];
    EXPECT_EQ(static_cast<int>(alone.reason), static_cast<int>(together[i].reason));
    EXPECT_EQ(alone.tried_scans, together[i].tried_scans);
    EXPECT_EQ(alone.scans_with_reason, together[i].scans_with_reason);
    EXPECT_EQ(alone.scan, together[i].scan);
  }
}

TEST(Explanation, StopsWhenCancelled) {
  const auto scene = BuildScene(Cube(), 1);
  ASSERT_NE(scene, nullptr);
  const std::vector<uint32_t> targets(1'000'000, 0);
  std::vector<TargetExplanation> explanations(targets.size());
  const std::atomic<bool> cancelled = true;
  scene->Explain(ThesisDomain(), targets, explanations, &cancelled);
  EXPECT_EQ(explanations.back().tried_scans, 0);
}

TEST(Explanation, AimedScansLieInTheDomain) {
  MeasurementDomain domain = FromAbove();
  domain.parameters[6] = {.ranges = {}, .values = {0, 1, 2}, .periodic = true};
  domain.parameters[8] = Between(-0.01, 0.01);
  const Rig rig;
  Random random(3);
  for (int i = 0; i < 2000; ++i) {
    const AimedScan aimed = MakeAimedScan(rig, domain, SpreadAim(i));
    const Eigen::Vector3d place = 0.1 * random.Direction();
    const ScanOfPlace scan = AimAt(aimed, domain, {0, 0, 0.01}, place);
    EXPECT_TRUE(domain.Contains(scan.measurement));
    // The sheet goes through the place when the stage is where it is said to be.
    const ScanGeometry g = MakeScanGeometry(rig, scan.measurement);
    const Eigen::Vector3d x = PartToWorld(g, {0, 0, 0.01}, place, scan.stage_m);
    EXPECT_NEAR(g.sheet_normal.dot(x), 0, 1e-9);
    EXPECT_NEAR((g.camera.origin_m - x - scan.to_camera_m).norm(), 0, 1e-9);
  }
}

// Brute-force result for a target: scans of the domain drawn at random that have the target in
// the image's centre, judged by Embree.
struct Sampled {
  int facing = 0;  // both sensors
  int seen = 0;    // from both
};

Sampled SampleByEmbree(const EmbreeJudge& judge, const MeasurementDomain& domain,
                       const Eigen::Vector3d& place, const Eigen::Vector3d& normal, int scans,
                       Random& random) {
  const auto draw = [&](int parameter) {
    double length = 0;
    for (const auto& range : domain.parameters[parameter].ranges) length += range.max - range.min;
    double rest = random.Uniform(0, length);
    for (const auto& range : domain.parameters[parameter].ranges) {
      if (rest <= range.max - range.min) return range.min + rest;
      rest -= range.max - range.min;
    }
    return domain.parameters[parameter].ranges.back().max;
  };
  Sampled sampled;
  for (int i = 0; i < scans; ++i) {
    const double distance = draw(0), tau = draw(1), azimuth = draw(2), polar = draw(3);
    double alpha = draw(4), beta = draw(5);
    if (!domain.resting_orientations.empty()) {
      const auto& o =
          domain.resting_orientations[random.Next() % domain.resting_orientations.size()];
      alpha = o.part_alpha_rad;
      beta = o.part_beta_rad;
    }
    const Eigen::Matrix3d to_part = (Eigen::AngleAxisd(draw(6), Eigen::Vector3d::UnitZ()) *
                                     Eigen::AngleAxisd(beta, Eigen::Vector3d::UnitY()) *
                                     Eigen::AngleAxisd(alpha, Eigen::Vector3d::UnitX()))
                                        .toRotationMatrix()
                                        .transpose();
    const auto towards = [&](double angle) -> Eigen::Vector3d {
      return to_part * Eigen::Vector3d(std::sin(angle) * std::cos(azimuth),
                                       std::sin(angle) * std::sin(azimuth), std::cos(angle));
    };
    const Eigen::Vector3d camera = towards(polar), laser = towards(polar - tau);
    if (normal.dot(camera) <= 0 || normal.dot(laser) <= 0) continue;
    ++sampled.facing;
    sampled.seen += !judge.Occluded(place + distance * camera, place, 2e-5) &&
                    !judge.Occluded(place + distance * laser, place, 2e-5);
  }
  return sampled;
}

// Agreement of the reasons with brute force, of 200 targets that a small plan leaves uncovered.
void ExpectEmbreeAgrees(const MeasurementDomain& domain, double least_agreement) {
  constexpr int kTargets = 200, kScansEach = 10000;
  SceneDefinition definition;
  definition.part = CylinderHead();
  ASSERT_FALSE(definition.part.triangles.empty());
  definition.field_directions = 256;
  const EmbreeJudge judge(definition.part);
  const auto scene = BuildScene(definition, 2);
  ASSERT_NE(scene, nullptr);
  Random random(5);
  TargetBits covered(scene->targets().size());
  for (int i = 0; i < 6; ++i) {
    Measurement m = RandomMeasurement(random);
    if (!domain.resting_orientations.empty()) {
      m.part_alpha_rad = domain.resting_orientations[0].part_alpha_rad;
      m.part_beta_rad = domain.resting_orientations[0].part_beta_rad;
    }
    covered |= scene->EvaluateExact(m, nullptr, nullptr).covered;
  }
  std::vector<uint32_t> targets;
  while (targets.size() < kTargets) {
    const auto t = static_cast<uint32_t>(random.Next() % scene->targets().size());
    if (!covered.Test(t)) targets.push_back(t);
  }
  const auto explanations = Explain(*scene, domain, targets);
  // By claim: targets, and those that brute force says the same of.
  std::map<UncoveredReason, std::pair<int, int>> claims;
  int agree = 0, exact = 0, not_chosen = 0;
  for (size_t i = 0; i < targets.size(); ++i) {
    const uint32_t t = targets[i];
    const Sampled sampled =
        SampleByEmbree(judge, domain, scene->targets().positions_m[t].cast<double>(),
                       scene->targets().normals[t].cast<double>(), kScansEach, random);
    const UncoveredReason judged = sampled.seen > 0     ? UncoveredReason::kNotChosen
                                   : sampled.facing > 0 ? UncoveredReason::kOwnOcclusion
                                                        : UncoveredReason::kAngle;
    auto& [count, same] = claims[explanations[i].reason];
    ++count;
    same += judged == explanations[i].reason;
    agree += judged == explanations[i].reason;
    if (explanations[i].reason == UncoveredReason::kNotChosen) {
      ++not_chosen;
      const ExactCoverage coverage = scene->EvaluateExact(explanations[i].scan, nullptr, nullptr);
      exact += coverage.feasibility == Feasibility::kFeasible && coverage.covered.Test(t);
    } else if (judged != explanations[i].reason) {
      std::printf("target %u: claim %d, of %d scans %d face it and %d see it\n", t,
                  static_cast<int>(explanations[i].reason), kScansEach, sampled.facing,
                  sampled.seen);
    }
  }
  for (const auto& [reason, counts] : claims) {
    std::printf("reason %d: %d targets, brute force agrees on %d\n", static_cast<int>(reason),
                counts.first, counts.second);
  }
  std::printf("agreement %d of %d; of %d not chosen the scan found covers %d exactly\n", agree,
              kTargets, not_chosen, exact);
  EXPECT_GE(agree, least_agreement * kTargets);
  EXPECT_GE(exact, 0.95 * not_chosen);
}

TEST(Explanation, EmbreeAgreesWithPartsThatTurnFreely) { ExpectEmbreeAgrees(ThesisDomain(), 0.95); }

TEST(Explanation, EmbreeAgreesWithAPartThatLies) {
  MeasurementDomain domain = ThesisDomain();
  domain.resting_orientations = {{0, 0}};
  domain.parameters[3] = Between(0, 60 * kRadPerDeg);
  ExpectEmbreeAgrees(domain, 0.95);
}

}  // namespace
}  // namespace sightline
