// SPDX-License-Identifier: Apache-2.0
#include "planning/requirements/requirements.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/surface_inference/surface_inference.h"
#include "planning/requirements/feature_verdicts.h"
#include "planning/requirements/known_targets.h"
#include "planning/requirements/reach.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// Two squares of 100 mm side by side in the plane z = 0, the second of material "ground".
TriangleMesh TwoSquares() {
  TriangleMesh mesh;
  mesh.positions_m = {{0, 0, 0},    {0.1f, 0, 0},    {0.2f, 0, 0},
                      {0, 0.1f, 0}, {0.1f, 0.1f, 0}, {0.2f, 0.1f, 0}};
  mesh.triangles = {{0, 1, 4}, {0, 4, 3}, {1, 2, 5}, {1, 5, 4}};
  mesh.material_names = {"cast", "ground"};
  mesh.triangle_material = {0, 0, 1, 1};
  return mesh;
}

TargetSet GridTargets() {
  TargetSet targets;
  for (int i = 0; i < 20; ++i) {
    for (int j = 0; j < 10; ++j) {
      targets.positions_m.emplace_back(0.005f + 0.01f * static_cast<float>(i),
                                       0.005f + 0.01f * static_cast<float>(j), 0.0f);
      targets.normals.emplace_back(0, 0, 1);
      targets.regions.push_back(-1);
    }
  }
  return targets;
}

Inspection Task() {
  Inspection inspection;
  inspection.uncertainty.emplace();
  inspection.tolerances.emplace();
  inspection.goal.admissible = 0.8;
  inspection.domain = ThesisDomain();
  return inspection;
}

TEST(Requirements, TheNarrowestZoneThatBindsATargetCounts) {
  Inspection inspection = Task();
  inspection.tolerances->zone_width_m = 0.001;
  inspection.tolerances->regions.push_back({"ground", 0.0002, std::nullopt, {"ground"}, {}});
  inspection.tolerances->regions.push_back(
      {"corner",
       0.0004,
       Eigen::AlignedBox3d(Eigen::Vector3d(0.15, 0.05, -0.01), Eigen::Vector3d(0.3, 0.2, 0.01)),
       {},
       {}});
  const auto requirements = MakeRequirements(inspection, TwoSquares(), std::nullopt, {});
  ASSERT_TRUE(requirements.ok()) << requirements.status();
  const TargetSet targets = GridTargets();
  const std::vector<float> admissible = requirements->AdmissibleUncertainties(targets);
  for (size_t t = 0; t < targets.size(); ++t) {
    // The thesis's quarter of the zone.
    const float expected = targets.positions_m[t].x() > 0.1f ? 0.00005f : 0.00025f;
    EXPECT_FLOAT_EQ(admissible[t], expected) << t;
  }
  EXPECT_EQ(requirements->TargetsOf(requirements->features[0], targets).size(), 100u);
  EXPECT_EQ(requirements->TargetsOf(requirements->features[1], targets).size(), 25u);
  EXPECT_DOUBLE_EQ(requirements->relaxed_uncertainty_m, 0.001);  // a tenth of the prior
}

TEST(Requirements, RefusesWhatThePartHasNot) {
  const auto expect = [](Inspection inspection, const std::string& text) {
    const auto requirements = MakeRequirements(inspection, TwoSquares(), std::nullopt, {});
    EXPECT_EQ(requirements.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(requirements.status().message()), HasSubstr(text));
  };
  Inspection inspection = Task();
  inspection.tolerances->regions.push_back({"a", 0.0002, std::nullopt, {"milled"}, {}});
  expect(inspection, "no material \"milled\"; it has cast, ground");
  inspection = Task();
  inspection.tolerances->regions.push_back({"a", 0.0002, std::nullopt, {}, {7}});
  expect(inspection, "has no face 7");
  inspection = Task();
  inspection.tolerances->zone_width_m = 0.5;
  expect(inspection, "tolerances.zone_width_m is 0.5 m, must be below the part's size");
  inspection = Task();
  inspection.tolerances->file = "a.stp";
  expect(inspection, "holds no tolerance that can be planned for");
}

// A rectangle of the file of tolerances in the plane z, wound so that it faces up or down.
FaceTriangles Rectangle(int number, double x_m, double z_m, bool up = true) {
  FaceTriangles face{number, {}, {}};
  face.positions_m = {{0, 0, z_m}, {x_m, 0, z_m}, {x_m, 0.1, z_m}, {0, 0.1, z_m}};
  if (up) {
    face.triangles = {{0, 1, 2}, {0, 2, 3}};
  } else {
    face.triangles = {{0, 2, 1}, {0, 3, 2}};
  }
  return face;
}

// A file of another revision has the same names and faces at other places.
TEST(Requirements, FacesThatAToleranceBindsLieOnThePart) {
  Inspection inspection = Task();
  inspection.tolerances->file = "part.stp";
  const auto require = [&](const FaceTriangles& face, bool by_region) {
    ToleranceReport report;
    Inspection task = inspection;
    if (by_region) {
      task.tolerances->regions.push_back({"a", 0.0002, std::nullopt, {}, {face.face}});
    } else {
      Tolerance tolerance;
      tolerance.id = "#57";
      tolerance.name = "flat";
      tolerance.zone_width_m = 0.0002;
      tolerance.faces = {face.face};
      report.read.push_back(tolerance);
    }
    // Faces that nothing binds may be anywhere: the file may hold other bodies, too.
    return MakeRequirements(task, TwoSquares(), report, {face, Rectangle(99, 0.2, 5)}).status();
  };
  for (const bool by_region : {false, true}) {
    const std::string by = by_region ? "tolerances.regions[0]" : "part.stp: tolerance flat";
    EXPECT_TRUE(require(Rectangle(3, 0.2, 0), by_region).ok());
    EXPECT_TRUE(require(Rectangle(3, 0.1, 0), by_region).ok());
    EXPECT_TRUE(require(Rectangle(3, 0.2, 0.00015), by_region).ok());  // two chord tolerances
    struct Wrong {
      FaceTriangles face;
      const char* words;
    };
    for (const Wrong& wrong : {Wrong{Rectangle(3, 0.2, 0.012), "lies 12.000 mm off"},
                               Wrong{Rectangle(3, 0.2, -0.0003), "lies 0.300 mm off"},
                               // Half of it lies on the part.
                               Wrong{Rectangle(3, 0.4, 0), "lies 200.000 mm off"},
                               Wrong{Rectangle(3, 0.2, 1000), "off the part's mesh"},
                               Wrong{Rectangle(3, 0.2, 0, false), "faces the other way"}}) {
      const absl::Status refused = require(wrong.face, by_region);
      EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument) << wrong.words;
      EXPECT_THAT(std::string(refused.message()),
                  AllOf(HasSubstr(by), HasSubstr("face 3"), HasSubstr(wrong.words)));
    }
  }
}

TEST(Requirements, AZoneBeyondTheRigIsRefusedAtOnce) {
  Inspection inspection = Task();
  inspection.rig.scan_step_m = 0.0005;
  inspection.tolerances->zone_width_m = 0.0002;  // thesis Table 6.5
  auto requirements = MakeRequirements(inspection, TwoSquares(), std::nullopt, {});
  ASSERT_TRUE(requirements.ok());
  EXPECT_TRUE(CheckReach(inspection, *requirements).ok());
  inspection.tolerances->zone_width_m = 2e-7;
  requirements = MakeRequirements(inspection, TwoSquares(), std::nullopt, {});
  ASSERT_TRUE(requirements.ok());
  const absl::Status status = CheckReach(inspection, *requirements);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("out of reach of this rig"));
}

TEST(BestInformationDensity, GrowsAsFramesAndNoiseShrink) {
  Rig rig;
  UncertaintyModel model;
  const double density = BestInformationDensity(rig, model, ThesisDomain());
  rig.scan_step_m /= 2;
  EXPECT_NEAR(BestInformationDensity(rig, model, ThesisDomain()) / density, 2, 1e-9);
  model.detection.standard_deviations_px = {0.1};
  EXPECT_NEAR(BestInformationDensity(rig, model, ThesisDomain()) / density, 8, 1e-9);
}

PlanKnowledge KnowAll(const TargetSet& targets, const TargetBits& measurable, double u_m) {
  PlanKnowledge knowledge;
  knowledge.targets = &targets;
  knowledge.measurable = &measurable;
  knowledge.uncertainty.assign(targets.size(), {u_m, u_m, 0, 0});
  knowledge.points.assign(targets.size(), 100);
  return knowledge;
}

TEST(FeatureVerdicts, ProfilesAreJudgedByTheirTargets) {
  Inspection inspection = Task();
  inspection.tolerances->regions.push_back({"ground", 0.0002, std::nullopt, {"ground"}, {}});
  const auto requirements = MakeRequirements(inspection, TwoSquares(), std::nullopt, {});
  ASSERT_TRUE(requirements.ok());
  const TargetSet targets = GridTargets();
  TargetBits measurable(targets.size());
  for (size_t t = 0; t < targets.size(); ++t) measurable.Set(t);
  auto verdicts = JudgeFeatures(inspection, *requirements, KnowAll(targets, measurable, 2e-5));
  ASSERT_EQ(verdicts.size(), 1u);
  EXPECT_TRUE(verdicts[0].can_be_proven()) << verdicts[0].because();
  EXPECT_EQ(verdicts[0].targets(), 100);
  EXPECT_EQ(verdicts[0].admissible_targets(), 100);
  EXPECT_NEAR(verdicts[0].acceptance_zone_m(), 0.0002 - 4 * 2e-5, 1e-9);
  verdicts = JudgeFeatures(inspection, *requirements, KnowAll(targets, measurable, 8e-5));
  EXPECT_FALSE(verdicts[0].can_be_proven());
  EXPECT_EQ(verdicts[0].admissible_targets(), 0);
}

TEST(FeatureVerdicts, AFittedPlaneAveragesOverItsTargets) {
  Inspection inspection = Task();
  inspection.tolerances->regions.push_back({"ground", 0.0002, std::nullopt, {"ground"}, {}});
  auto requirements = MakeRequirements(inspection, TwoSquares(), std::nullopt, {});
  ASSERT_TRUE(requirements.ok());
  requirements->features[0].kind = ToleranceKind::kPosition;
  const TargetSet targets = GridTargets();
  TargetBits measurable(targets.size());
  const auto verdicts =
      JudgeFeatures(inspection, *requirements, KnowAll(targets, measurable, 8e-5));
  // Worst at a corner: 1/n for the offset and 3/n for each tilt.
  EXPECT_NEAR(verdicts[0].uncertainty_m(), 8e-5 * std::sqrt(7.0 / 100), 0.1 * 8e-5);
  EXPECT_TRUE(verdicts[0].can_be_proven()) << verdicts[0].because();
}

TEST(FeatureVerdicts, TooFewTargetsAreSaid) {
  Inspection inspection = Task();
  inspection.tolerances->regions.push_back(
      {"spot",
       0.0002,
       Eigen::AlignedBox3d(Eigen::Vector3d(0, 0, -1), Eigen::Vector3d(0.012, 0.022, 1)),
       {},
       {}});
  const auto requirements = MakeRequirements(inspection, TwoSquares(), std::nullopt, {});
  ASSERT_TRUE(requirements.ok());
  const TargetSet targets = GridTargets();
  TargetBits measurable(targets.size());
  const auto verdicts =
      JudgeFeatures(inspection, *requirements, KnowAll(targets, measurable, 1e-5));
  EXPECT_FALSE(verdicts[0].can_be_proven());
  EXPECT_THAT(verdicts[0].because(), HasSubstr("only 2 targets lie on it"));
}

// Tolerances of a file that bind the whole of the two squares, face 3.
Tolerance FileTolerance(const std::string& name, ToleranceKind kind,
                        const std::vector<std::string>& datums = {}) {
  Tolerance tolerance;
  tolerance.id = "#" + name;
  tolerance.name = name;
  tolerance.kind = kind;
  tolerance.zone_width_m = 0.0002;
  tolerance.faces = {3};
  tolerance.datums = datums;
  return tolerance;
}

absl::StatusOr<Requirements> RequirementsOf(const Inspection& inspection,
                                            const std::vector<Tolerance>& tolerances) {
  ToleranceReport report;
  report.read = tolerances;
  return MakeRequirements(inspection, TwoSquares(), report, {Rectangle(3, 0.2, 0)});
}

TEST(Association, IsThatOfCharacteristicsThatHaveAMinimumZone) {
  Inspection inspection = Task();
  inspection.tolerances->file = "part.stp";
  const std::vector<Tolerance> tolerances = {
      FileTolerance("flat", ToleranceKind::kFlatness),
      FileTolerance("free profile", ToleranceKind::kSurfaceProfile),
      FileTolerance("profile to A", ToleranceKind::kSurfaceProfile, {"A"}),
      FileTolerance("level", ToleranceKind::kParallelism, {"A"})};
  auto requirements = RequirementsOf(inspection, tolerances);
  ASSERT_TRUE(requirements.ok()) << requirements.status();
  for (const TolerancedFeature& feature : requirements->features) {
    EXPECT_EQ(feature.association, Association::kGauss);
  }
  inspection.tolerances->association = Association::kChebyshev;
  requirements = RequirementsOf(inspection, tolerances);
  ASSERT_TRUE(requirements.ok()) << requirements.status();
  EXPECT_EQ(requirements->features[0].association, Association::kChebyshev);
  EXPECT_EQ(requirements->features[1].association, Association::kChebyshev);
  EXPECT_EQ(requirements->features[2].association, Association::kGauss);
  EXPECT_EQ(requirements->features[3].association, Association::kGauss);
  // It is never ignored silently.
  const auto none = RequirementsOf(inspection, {tolerances[3]});
  EXPECT_EQ(none.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(none.status().message()),
              HasSubstr("tolerances.association is CHEBYSHEV"));
}

TEST(Association, IsStatedByVerdicts) {
  Inspection inspection = Task();
  inspection.tolerances->file = "part.stp";
  const std::vector<Tolerance> tolerances = {
      FileTolerance("flat", ToleranceKind::kFlatness),
      FileTolerance("free profile", ToleranceKind::kSurfaceProfile)};
  const TargetSet targets = GridTargets();
  TargetBits measurable(targets.size());
  const PlanKnowledge knowledge = KnowAll(targets, measurable, 5e-6);
  const auto by_gauss = RequirementsOf(inspection, tolerances);
  inspection.tolerances->association = Association::kChebyshev;
  const auto by_zone = RequirementsOf(inspection, tolerances);
  ASSERT_TRUE(by_gauss.ok() && by_zone.ok());
  const auto gauss = JudgeFeatures(inspection, *by_gauss, knowledge);
  const auto zone = JudgeFeatures(inspection, *by_zone, knowledge);
  ASSERT_EQ(zone.size(), 2u);
  for (size_t f = 0; f < 2; ++f) {
    EXPECT_THAT(zone[f].because(), HasSubstr("association: minimum zone (CHEBYSHEV)"));
    EXPECT_EQ(gauss[f].because().find("association"), std::string::npos);
    EXPECT_TRUE(zone[f].can_be_proven()) << zone[f].because();
  }
  // Errors make less of a minimum zone than of the range that least squares leaves.
  EXPECT_LT(zone[0].bias_m(), gauss[0].bias_m());
  EXPECT_GT(zone[0].bias_m(), 0.8 * gauss[0].bias_m());
  EXPECT_NEAR(zone[0].uncertainty_m(), gauss[0].uncertainty_m(), 1e-9);
  // Twice a largest deviation has a bias as form has.
  EXPECT_GT(zone[1].bias_m(), 2 * 2 * 5e-6);
}

// The model of `10 +0.05/0` is made to the lower limit: a part like it cannot be proven, and
// production aims at the middle.
TEST(MiddleOfLimits, IsStatedWhereTheModelLiesElsewhere) {
  Tolerance size = FileTolerance("bore", ToleranceKind::kLinearSize);
  size.lower_m = 0.01;
  size.upper_m = 0.01005;
  CharacteristicFit fit;
  fit.model_sizes_m = {0.01};
  EXPECT_EQ(MiddleOfLimitsText(&size, fit),
            "; a good part is taken in the middle of its limits, 25 um from the modelled size");
  fit.model_sizes_m = {0.010025};
  EXPECT_EQ(MiddleOfLimitsText(&size, fit), "");
  size.upper_m = std::nullopt;
  EXPECT_EQ(MiddleOfLimitsText(&size, fit), "");
  EXPECT_EQ(MiddleOfLimitsText(nullptr, fit), "");
}

}  // namespace
}  // namespace sightline
