// SPDX-License-Identifier: Apache-2.0
// Values and decisions from deviations that are made by hand, and how often intervals hold.
#include "core/conformance/measured_value.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "absl/status/statusor.h"
#include "core/random/counter_random.h"

namespace sightline {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

struct HandMade {
  Feature feature;
  Characteristic characteristic;
  double noise_m = 1e-6;

  void Add(FeatureElement& element, const Vector3d& position_m, const Vector3d& normal) {
    FeatureTarget target;
    target.position_m = position_m;
    target.normal = normal;
    target.uncertainty = {noise_m, noise_m, 0, 0};
    element.targets.push_back(static_cast<int>(feature.targets.size()));
    feature.targets.push_back(target);
  }
  // A square plate of n x n targets across z at a height; `up`: its normal is +z.
  FeatureElement Plate(double side_m, int n, double z_m, bool up = true) {
    FeatureElement plate;
    plate.surface.kind = SurfaceKind::kPlane;
    plate.surface.axis = up ? Vector3d(0, 0, 1) : Vector3d(0, 0, -1);
    plate.surface.point_m = {0, 0, z_m};
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        Add(plate, {side_m * (i / (n - 1.0) - 0.5), side_m * (j / (n - 1.0) - 0.5), z_m},
            plate.surface.axis);
      }
    }
    return plate;
  }
  // A bore along z about the origin.
  FeatureElement BoreOf(double radius_m, double depth_m) {
    FeatureElement bore;
    bore.surface.kind = SurfaceKind::kCylinder;
    bore.surface.radius_m = radius_m;
    for (int k = 0; k < 5; ++k) {
      for (int i = 0; i < 24; ++i) {
        const double angle = 2 * std::numbers::pi * i / 24;
        const Vector3d r(std::cos(angle), std::sin(angle), 0);
        Add(bore, radius_m * r + Vector3d(0, 0, depth_m * (k / 4.0 - 0.5)), -r);
      }
    }
    return bore;
  }
  VectorXd Deviations(const std::function<double(const FeatureTarget&)>& of) const {
    VectorXd h(static_cast<Eigen::Index>(feature.targets.size()));
    for (Eigen::Index i = 0; i < h.size(); ++i) h[i] = of(feature.targets[static_cast<size_t>(i)]);
    return h;
  }
  MeasuredValue Value(const VectorXd& deviations_m, const MeasuredZone& zone) const {
    const auto fit = FitCharacteristic(feature, characteristic);
    EXPECT_TRUE(fit.ok()) << fit.status();
    if (!fit.ok()) return {};
    const auto value = EvaluateMeasured(feature, *fit, deviations_m, zone);
    EXPECT_TRUE(value.ok()) << value.status();
    return value.ok() ? *value : MeasuredValue{};
  }
};

// A plane tilted by 1 mrad about y falls by 1 mrad times its extent, here the side of 40 mm.
TEST(MeasuredValue, FallOfATiltedPlane) {
  HandMade part;
  part.characteristic.kind = ToleranceKind::kParallelism;
  part.characteristic.exact_datum = true;
  part.characteristic.elements = {part.Plate(0.04, 9, 0)};
  const VectorXd h = part.Deviations([](const auto& t) { return 1e-3 * t.position_m.x(); });
  EXPECT_NEAR(part.Value(h, {.width_m = 1e-4}).value_m, 4e-5, 1e-9);
  EXPECT_EQ(part.Value(h, {.width_m = 1e-4}).decision, Conformity::kConforms);
  EXPECT_EQ(part.Value(h, {.width_m = 2e-5}).decision, Conformity::kDoesNotConform);
  EXPECT_EQ(part.Value(h, {.width_m = 4e-5}).decision, Conformity::kUndecided);
}

// The same tilt of plane and datum is none.
TEST(MeasuredValue, ADatumThatIsTiltedLikewiseLeavesNoFall) {
  HandMade part;
  part.characteristic.kind = ToleranceKind::kParallelism;
  part.characteristic.elements = {part.Plate(0.04, 9, 0.02)};
  part.characteristic.datums = {{part.Plate(0.04, 9, 0, false)}};
  const VectorXd h = part.Deviations(
      [](const auto& t) { return 1e-3 * t.position_m.x() * (t.normal.z() > 0 ? 1 : -1); });
  EXPECT_NEAR(part.Value(h, {.width_m = 1e-4}).value_m, 0, 1e-9);
  // So is an error of the pose that both share.
  part.feature.common_deviations_m.resize(h.size(), 1);
  part.feature.common_deviations_m.col(0) = h;
  EXPECT_LT(part.Value(h, {.width_m = 1e-4}).uncertainty_m, 1e-6);
  part.characteristic.datums.clear();
  part.characteristic.exact_datum = true;
  EXPECT_NEAR(part.Value(h, {.width_m = 1e-4}).uncertainty_m, 4e-5, 2e-6);
}

// A bore that is 30 um too large in diameter has 15 um less material all around: its surface lies
// along -normal.
TEST(MeasuredValue, DiameterOfABoreThatIsTooLarge) {
  HandMade part;
  part.characteristic.kind = ToleranceKind::kLinearSize;
  part.characteristic.elements = {part.BoreOf(0.01, 0.02)};
  const VectorXd h = part.Deviations([](const auto&) { return -15e-6; });
  const MeasuredZone zone{.width_m = 21e-6, .lower_m = 0.020, .upper_m = 0.020021};
  const MeasuredValue value = part.Value(h, zone);
  EXPECT_NEAR(value.value_m, 0.02003, 1e-9);
  EXPECT_EQ(value.decision, Conformity::kDoesNotConform) << value.because;
  const VectorXd fits = part.Deviations([](const auto&) { return -5e-6; });
  EXPECT_EQ(part.Value(fits, zone).decision, Conformity::kConforms);
  part.characteristic.radius = true;
  EXPECT_NEAR(part.Value(h, {.width_m = 1e-4}).value_m, 0.010015, 1e-9);
}

// Walls get thicker and slots narrower where their planes rise out of the material.
TEST(MeasuredValue, WidthOfAWallAndOfASlot) {
  for (const bool slot : {false, true}) {
    HandMade part;
    part.characteristic.kind = ToleranceKind::kLinearSize;
    FeatureElement width = part.Plate(0.03, 5, 0.005, !slot);
    const FeatureElement other = part.Plate(0.03, 5, -0.005, slot);
    width.width = true;
    width.targets.insert(width.targets.end(), other.targets.begin(), other.targets.end());
    part.characteristic.elements = {width};
    const VectorXd h = part.Deviations([](const auto&) { return 10e-6; });
    EXPECT_NEAR(part.Value(h, {.width_m = 1e-4}).value_m, 0.01 + (slot ? -20e-6 : 20e-6), 1e-9)
        << slot;
  }
}

// Planes 20 mm apart, of which the far one is 12 um farther: whichever comes first.
TEST(MeasuredValue, DistanceGrowsWithTheSurfaces) {
  for (const bool far_first : {false, true}) {
    HandMade part;
    part.characteristic.kind = ToleranceKind::kLinearDistance;
    const FeatureElement near = part.Plate(0.03, 5, 0), far = part.Plate(0.03, 5, 0.02);
    part.characteristic.elements = {near, far};
    if (far_first) part.characteristic.elements = {far, near};
    const VectorXd h =
        part.Deviations([](const auto& t) { return t.position_m.z() > 0.01 ? 12e-6 : 0; });
    EXPECT_NEAR(part.Value(h, {.width_m = 1e-4}).value_m, 0.020012, 1e-9) << far_first;
  }
}

// A hole 0.1 mm beside its place has the position value 0.2 mm.
TEST(MeasuredValue, PositionOfAHoleBesideItsPlace) {
  HandMade part;
  part.characteristic.kind = ToleranceKind::kPosition;
  part.characteristic.exact_datum = true;
  part.characteristic.elements = {part.BoreOf(0.005, 0.02)};
  const Vector3d off = 1e-4 * Vector3d(0.6, 0.8, 0);
  const VectorXd h = part.Deviations([&](const auto& t) { return off.dot(t.normal); });
  const MeasuredValue value = part.Value(h, {.width_m = 1.5e-4});
  // Directions are 5 degrees apart.
  EXPECT_NEAR(value.value_m, 2e-4, 3e-7);
  EXPECT_EQ(value.decision, Conformity::kDoesNotConform) << value.because;
  EXPECT_EQ(part.Value(h, {.width_m = 2.5e-4}).decision, Conformity::kConforms);
  // At maximum material a hole that is 60 um wider in diameter gives 30 um to either side.
  part.characteristic.material = MaterialRequirement::kMaximum;
  const VectorXd wider = h.array() - 30e-6;
  EXPECT_NEAR(part.Value(wider, {.width_m = 1.5e-4}).value_m, 2e-4 - 6e-5, 3e-7);
  part.characteristic.material = MaterialRequirement::kLeast;
  EXPECT_NEAR(part.Value(wider, {.width_m = 1.5e-4}).value_m, 2e-4 + 6e-5, 3e-7);
}

// One target of 400 lies 60 um inside.
TEST(MeasuredValue, ProfileIsThatOfItsWorstTarget) {
  HandMade part;
  part.characteristic.exact_datum = true;
  part.characteristic.elements = {part.Plate(0.04, 20, 0)};
  VectorXd h = part.Deviations([](const auto&) { return 5e-6; });
  h[123] = -60e-6;
  const MeasuredValue value = part.Value(h, {.width_m = 1e-4});
  EXPECT_NEAR(value.value_m, 1.2e-4, 1e-9);
  EXPECT_EQ(value.worst_target, 123);
  ASSERT_TRUE(value.deviations.has_value());
  EXPECT_NEAR(value.deviations->lower_m, -60e-6, 1e-12);
  EXPECT_NEAR(value.deviations->upper_m, 5e-6, 1e-12);
  EXPECT_EQ(value.decision, Conformity::kDoesNotConform) << value.because;
  EXPECT_EQ(part.Value(h, {.width_m = 2e-4}).decision, Conformity::kConforms);
}

TEST(MeasuredValue, TooFewTargetsLeaveItOpenUnlessADefectIsProven) {
  HandMade part;
  part.characteristic.exact_datum = true;
  part.characteristic.elements = {part.Plate(0.04, 10, 0)};
  for (int i = 0; i < 10; ++i) part.feature.targets[static_cast<size_t>(i)].measured = false;
  VectorXd h = part.Deviations([](const auto&) { return 0; });
  EXPECT_EQ(part.Value(h, {.width_m = 1e-4}).decision, Conformity::kUndecided);
  h[50] = 80e-6;
  EXPECT_EQ(part.Value(h, {.width_m = 1e-4}).decision, Conformity::kDoesNotConform);
  // Up to 5 % may be missing.
  for (int i = 5; i < 10; ++i) part.feature.targets[static_cast<size_t>(i)].measured = true;
  h[50] = 0;
  EXPECT_EQ(part.Value(h, {.width_m = 1e-4}).decision, Conformity::kConforms);
}

// Two percent of the targets are known to 0.5 mm only, five times the zone.
TEST(MeasuredValue, HardlyKnownTargetsNeitherAccuseNorCount) {
  HandMade part;
  part.characteristic.exact_datum = true;
  part.characteristic.elements = {part.Plate(0.04, 10, 0)};
  for (const size_t i : {size_t{3}, size_t{4}})
    part.feature.targets[i].uncertainty = {5e-4, 5e-4, 0, 0};
  VectorXd h = part.Deviations([](const auto&) { return 2e-6; });
  h[3] = 4e-4;  // 0.8 of its uncertainty
  const MeasuredValue good = part.Value(h, {.width_m = 1e-4});
  EXPECT_EQ(good.decision, Conformity::kConforms) << good.because;
  EXPECT_NEAR(good.value_m, 4e-6, 1e-12);
  EXPECT_NEAR(good.deviations->upper_m, 2e-6, 1e-12);
  // A deviation that noise does not explain holds acceptance back. At such uncertainty it rejects
  // nothing.
  h[3] = 3e-3;
  const MeasuredValue doubtful = part.Value(h, {.width_m = 1e-4});
  EXPECT_EQ(doubtful.decision, Conformity::kUndecided) << doubtful.because;
  EXPECT_NEAR(doubtful.value_m, 4e-6, 1e-12);
  // A defect elsewhere has its own value.
  h[50] = 8e-5;
  const MeasuredValue dented = part.Value(h, {.width_m = 1e-4});
  EXPECT_EQ(dented.decision, Conformity::kDoesNotConform) << dented.because;
  EXPECT_NEAR(dented.value_m, 1.6e-4, 1e-9);
  EXPECT_LT(dented.uncertainty_m, 3e-6);
  EXPECT_EQ(dented.worst_target, 50);
}

// Five percent of the targets get ever better known, as by further scans. Good parts are accepted
// as often as where those targets are not measured at all: 200 draws at 0.95 are 181 at least (one
// in 1e4).
TEST(MeasuredValue, BetterKnownTargetsLoseNoVerdict) {
  for (const double u_m : {1e-3, 1e-4, 3e-5, 2.4e-5, 1.5e-5, 8e-6, 1e-6}) {
    HandMade part;
    part.characteristic.exact_datum = true;
    part.characteristic.elements = {part.Plate(0.04, 10, 0)};
    for (size_t i = 0; i < 5; ++i) part.feature.targets[i].uncertainty = {u_m, u_m, 0, 0};
    const auto fit = FitCharacteristic(part.feature, part.characteristic);
    ASSERT_TRUE(fit.ok()) << fit.status();
    int accepted = 0;
    for (uint64_t draw = 0; draw < 200; ++draw) {
      CounterRandom random(15, draw);
      const VectorXd h =
          part.Deviations([&](const auto& t) { return t.uncertainty.noise_m * random.Normal(); });
      const auto value = EvaluateMeasured(part.feature, *fit, h, {.width_m = 1e-4});
      ASSERT_TRUE(value.ok()) << value.status();
      accepted += value->decision == Conformity::kConforms;
    }
    EXPECT_GE(accepted, 181) << u_m;
    // A defect of such a target that noise does not explain still holds acceptance back.
    VectorXd h = VectorXd::Zero(100);
    h[2] = 5e-5 + 5 * u_m;
    EXPECT_NE(part.Value(h, {.width_m = 1e-4}).decision, Conformity::kConforms) << u_m;
  }
}

TEST(MeasuredValue, WrongInputIsNamed) {
  HandMade part;
  part.characteristic.exact_datum = true;
  part.characteristic.elements = {part.Plate(0.04, 5, 0)};
  const auto fit = FitCharacteristic(part.feature, part.characteristic);
  ASSERT_TRUE(fit.ok()) << fit.status();
  VectorXd h = part.Deviations([](const auto&) { return 0; });
  EXPECT_TRUE(
      absl::IsInvalidArgument(EvaluateMeasured(part.feature, *fit, h, {.width_m = 0}).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(
      EvaluateMeasured(part.feature, *fit, h.head(3), {.width_m = 1e-4}).status()));
  h[2] = std::nan("");
  EXPECT_TRUE(
      absl::IsInvalidArgument(EvaluateMeasured(part.feature, *fit, h, {.width_m = 1e-4}).status()));
}

TEST(SimultaneousGuardFactor, OneFunctionalHasTheRulesOwn) {
  EXPECT_DOUBLE_EQ(SimultaneousGuardFactor(1.65, 1, 1), 1.65);
  // Scheffe in two dimensions: sqrt(-2 ln alpha), alpha = Q(1.65) = 0.04947.
  EXPECT_NEAR(SimultaneousGuardFactor(1.65, 1000, 2), std::sqrt(-2 * std::log(0.049471)), 1e-4);
  // Bonferroni for ten: Q^-1(0.0049471).
  EXPECT_NEAR(SimultaneousGuardFactor(1.65, 10, 10), 2.5796, 1e-3);
}

// (2 Phi(z) - 1)^25 = 0.5 at z = 2.2066.
TEST(ProvableUncertainty, LeavesRoomForTheLargestError) {
  EXPECT_NEAR(ProvableUncertainty(1e-4, {2, 0}, 25), 5e-5 / (2 + 2.2066), 1e-9);
  EXPECT_NEAR(ProvableUncertainty(1e-4, {2, 0}, 1), 5e-5 / (2 + 0.67449), 1e-9);
}

// Bounds of a binomial count of 400 draws beyond which one test in a million falls, for a
// probability of at least 0.954 (kExpansion = 2).
constexpr int kDraws = 400;
constexpr int kFewestHeld = 359;

struct Held {
  int held = 0, accepted = 0, rejected = 0;
};
Held HeldBy(HandMade& part, const VectorXd& truth, double true_value_m, const MeasuredZone& zone,
            uint64_t seed) {
  Held counts;
  const auto fit = FitCharacteristic(part.feature, part.characteristic);
  EXPECT_TRUE(fit.ok()) << fit.status();
  if (!fit.ok()) return counts;
  for (int draw = 0; draw < kDraws; ++draw) {
    CounterRandom random(seed, static_cast<uint64_t>(draw));
    VectorXd h = truth;
    for (double& x : h) x += part.noise_m * random.Normal();
    const auto value = EvaluateMeasured(part.feature, *fit, h, zone);
    EXPECT_TRUE(value.ok()) << value.status();
    if (!value.ok()) return counts;
    counts.held +=
        true_value_m >= value->interval.lower_m && true_value_m <= value->interval.upper_m;
    counts.accepted += value->decision == Conformity::kConforms;
    counts.rejected += value->decision == Conformity::kDoesNotConform;
  }
  return counts;
}

TEST(MeasuredValue, IntervalsHoldAsOftenAsTheySay) {
  HandMade bore;
  bore.noise_m = 1e-5;
  bore.characteristic.kind = ToleranceKind::kLinearSize;
  bore.characteristic.elements = {bore.BoreOf(0.01, 0.02)};
  const VectorXd wider = bore.Deviations([](const auto&) { return -15e-6; });
  const Held size = HeldBy(bore, wider, 0.02003, {.width_m = 1e-4}, 1);
  EXPECT_GE(size.held, kFewestHeld);
  // A single functional holds no more often than it says: 0.954 of 400 is 382, and 398 are one in
  // 1e4.
  EXPECT_LE(size.held, 398);

  bore.characteristic.kind = ToleranceKind::kPosition;
  bore.characteristic.exact_datum = true;
  const VectorXd none = VectorXd::Zero(wider.size());
  EXPECT_GE(HeldBy(bore, none, 0, {.width_m = 1e-4}, 2).held, kFewestHeld);
  const VectorXd beside = bore.Deviations([](const auto& t) { return 2e-5 * t.normal.x(); });
  EXPECT_GE(HeldBy(bore, beside, 4e-5, {.width_m = 1e-4}, 3).held, kFewestHeld);

  HandMade plate;
  plate.noise_m = 1e-5;
  plate.characteristic.exact_datum = true;
  plate.characteristic.elements = {plate.Plate(0.04, 12, 0)};
  const VectorXd flat = VectorXd::Zero(144);
  EXPECT_GE(HeldBy(plate, flat, 0, {.width_m = 2e-4}, 4).held, kFewestHeld);
  plate.characteristic.kind = ToleranceKind::kFlatness;
  EXPECT_GE(HeldBy(plate, flat, 0, {.width_m = 2e-4}, 5).held, kFewestHeld);
}

// How often a good part is accepted, as predicted before the measurement and as it then comes out.
struct GoodPart {
  double predicted = 0, observed = 0;
};
GoodPart AcceptedGoodParts(HandMade& part, double width_m, uint64_t seed) {
  const auto fit = FitCharacteristic(part.feature, part.characteristic);
  EXPECT_TRUE(fit.ok()) << fit.status();
  if (!fit.ok()) return {};
  const auto verdict = JudgeCharacteristic(part.feature, fit, part.characteristic, width_m);
  EXPECT_TRUE(verdict.ok()) << verdict.status();
  if (!verdict.ok()) return {};
  EXPECT_EQ(verdict->can_be_proven, verdict->acceptance_probability >= kProvableAcceptance &&
                                        verdict->acceptance_zone_m > 0);
  const VectorXd none = VectorXd::Zero(static_cast<Eigen::Index>(part.feature.targets.size()));
  const Held held = HeldBy(part, none, 0, {.width_m = width_m}, seed);
  return {verdict->acceptance_probability, held.accepted / static_cast<double>(kDraws)};
}

// 2000 predicted and 400 observed draws: differences beyond 0.13 are one in 1e6.
TEST(MeasuredValue, APlanPredictsHowOftenAGoodPartIsAccepted) {
  HandMade plate;
  plate.noise_m = 1e-5;
  plate.characteristic.exact_datum = true;
  plate.characteristic.elements = {plate.Plate(0.04, 5, 0)};
  // Each of 25 targets keeps 20 um from the limit of 50 um: (2 Phi(3) - 1)^25 = 0.9346.
  const GoodPart profile = AcceptedGoodParts(plate, 1e-4, 11);
  EXPECT_NEAR(profile.predicted, 0.9346, 0.03);
  EXPECT_NEAR(profile.observed, profile.predicted, 0.13);
  // A zone of 60 um leaves 10 um: 0.6827^25 = 7e-5, though an acceptance zone of 20 um is left.
  EXPECT_LT(AcceptedGoodParts(plate, 6e-5, 12).predicted, 0.005);
  // Form and functionals, with zones for which acceptance is a matter of chance.
  plate.characteristic.kind = ToleranceKind::kFlatness;
  const GoodPart form = AcceptedGoodParts(plate, 7e-5, 13);
  EXPECT_NEAR(form.observed, form.predicted, 0.13);
  HandMade bore;
  bore.noise_m = 1e-5;
  bore.characteristic.kind = ToleranceKind::kPosition;
  bore.characteristic.exact_datum = true;
  bore.characteristic.elements = {bore.BoreOf(0.01, 0.02)};
  const GoodPart position = AcceptedGoodParts(bore, 1.6e-5, 14);
  EXPECT_GT(position.predicted, 0.02);
  EXPECT_LT(position.predicted, 0.98);
  EXPECT_NEAR(position.observed, position.predicted, 0.13);
}

// At the limit itself a part is accepted, or rejected, by chance: in no more than Q(2) = 2.3 % of
// the measurements. 25 of 400 are one in 1e5.
TEST(MeasuredValue, PartsAtTheLimitAreHardlyEverAcceptedOrRejected) {
  HandMade bore;
  bore.noise_m = 1e-5;
  bore.characteristic.kind = ToleranceKind::kLinearSize;
  bore.characteristic.elements = {bore.BoreOf(0.01, 0.02)};
  const VectorXd wider = bore.Deviations([](const auto&) { return -25e-6; });
  const Held size = HeldBy(bore, wider, 0.02005, {.width_m = 1e-4}, 6);
  EXPECT_LE(size.accepted, 25);
  EXPECT_LE(size.rejected, 25);
  bore.characteristic.kind = ToleranceKind::kPosition;
  bore.characteristic.exact_datum = true;
  const VectorXd beside = bore.Deviations([](const auto& t) { return 5e-5 * t.normal.x(); });
  const Held position = HeldBy(bore, beside, 1e-4, {.width_m = 1e-4}, 7);
  EXPECT_LE(position.accepted, 25);
  EXPECT_LE(position.rejected, 25);
  // Profiles: many targets at zero and one at the limit.
  HandMade plate;
  plate.noise_m = 1e-5;
  plate.characteristic.exact_datum = true;
  plate.characteristic.elements = {plate.Plate(0.04, 12, 0)};
  VectorXd dent = VectorXd::Zero(144);
  dent[70] = -5e-5;
  const Held profile = HeldBy(plate, dent, 1e-4, {.width_m = 1e-4}, 8);
  EXPECT_LE(profile.accepted, 25);
  EXPECT_LE(profile.rejected, 25);
}

}  // namespace
}  // namespace sightline
