// SPDX-License-Identifier: Apache-2.0
// The fit finds what the renderer was given.
#include "render_worker/diagnosis/fit/fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/diagnose.h"
#include "render_worker/diagnosis/fit/broyden_update.h"
#include "render_worker/diagnosis/fit/fit_quality.h"
#include "render_worker/diagnosis/fit/linear_fit.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

TEST(FitSet, FindsDeviationsWithinTheirErrors) {
  const SetupDeviation truth = SomeDeviations();
  const RecordedSet set = RenderSmallSet(truth, {}, 5);
  const SetModel model(set, {});
  const FitResult fit = FitNull(model);
  // The covariance is somewhat too large on purpose, never too small by much.
  EXPECT_LT(fit.chi_squared, 1.25 * fit.data_count);
  EXPECT_GT(fit.chi_squared, 0.5 * fit.data_count);
  SetupDeviation uncertainty = set.description.uncertainty;
  SetupDeviation found = fit.parameters.deviations, wanted = truth;
  int column = 0;
  for (int i = 0; i < kDeviations; ++i) {
    const double scale = DeviationAt(uncertainty, i);
    if (scale <= 0) continue;
    const double error = scale * std::sqrt(fit.covariance(column, column));
    EXPECT_NEAR(DeviationAt(found, i), DeviationAt(wanted, i), 4 * error) << kDeviationNames[i];
    EXPECT_LE(error, 1.0001 * scale);
    ++column;
  }
}

// Regression: a null model that had not converged within its rounds was used as it was, and its
// remaining error hid the effect that was present.
TEST(FitSet, GoesOnUntilItIsThere) {
  const RecordedSet set = MakeRecordedSet(SmallSetDescription(), {});
  const SetModel model(set, {});
  SetParameters truth;
  truth.deviations = SomeDeviations();
  truth.deviations.line_position_each_px = 0;
  const BlockVectors observed = model.Expect(truth, false).mean;
  FitSettings settings;
  settings.rounds = {{0.1, 0.3}, {0, 0}};
  settings.max_iterations = 1;
  settings.observed = &observed;
  const FitResult fit = FitSet(model, {}, {}, settings, nullptr);
  settings.rounds = {{0, 0}, {0, 0}};
  settings.max_iterations = 10;
  const FitResult further = FitSet(model, fit.parameters, {}, settings, nullptr);
  EXPECT_LT(fit.chi_squared + fit.prior, further.chi_squared + further.prior + 2);
}

// A bug found: where an effect does the same as a deviation, the fit stayed where it had come to.
TEST(FitSet, SharesOutByThePriorWhatTheDataCannot) {
  const RecordedSet set = MakeRecordedSet(SmallSetDescription(), {});
  const SetModel model(set, {});
  const Effect* error = FindEffect("optics.f_number_error");
  SetParameters parameters;
  parameters.effects = {{error, {0.8}}};
  const BlockVectors observed = model.Expect(parameters, false).mean;
  const double far = -0.04;  // of an uncertainty of 0.015
  parameters.deviations.f_number_relative = far;
  parameters.effects[0].parameters[0] = 0.8 / (1 + far);
  FitSettings settings;
  settings.rounds = {{0, 0}};
  settings.max_iterations = 2;
  settings.observed = &observed;
  const FitResult fit =
      FitSet(model, parameters, FreeParameters(parameters.effects), settings, nullptr);
  EXPECT_NEAR(fit.parameters.deviations.f_number_relative, 0, 0.2 * 0.015);
  EXPECT_NEAR(fit.parameters.effects[0].parameters[0], 0.8, 0.2 * 0.015);
}

TEST(FitPrior, WeightIsTheSlopeOfThePenalty) {
  constexpr double kStep = 1e-6;
  for (const double z : {-40.0, -2.0, -0.7, 0.3, 1.5, 12.0}) {
    const double slope = (FitPenalty(z + kStep) - FitPenalty(z - kStep)) / (2 * kStep);
    EXPECT_NEAR(slope, 2 * FitPriorWeight(z) * z, 1e-6 * (1 + std::abs(z))) << z;
  }
  EXPECT_NEAR(FitPenalty(1 + 1e-9), FitPenalty(1 - 1e-9), 1e-8);
}

// A bug found: a power of half the stated one came out as 0.6 of it, the rest as deviations of two
// or three uncertainties; and fits stopped where steps had to follow a curved valley.
TEST(FitSet, AStrongEffectIsNotPulledTowardsNone) {
  const RecordedSet set = MakeRecordedSet(SmallSetDescription(), {});
  const SetModel model(set, {});
  for (const auto& [id, value] : {std::pair{"illumination.power_error", 0.5},
                                  std::pair{"geometry.laser_distance_error", -0.06}}) {
    SetParameters truth;
    truth.effects = {{FindEffect(id), {value}}};
    const double null_value = truth.effects[0].effect->description().parameters[0].null_value;
    const BlockVectors observed = model.Expect(truth, false).mean;
    FitSettings settings;
    settings.observed = &observed;
    SetParameters start;
    const FitResult null = FitSet(model, start, {}, settings, nullptr);
    start.effects = {{truth.effects[0].effect, {0.7 * null_value + 0.3 * value}}};
    const std::vector<FreeEffectParameter> free = FreeParameters(start.effects);
    const FitResult fit = FitSet(model, start, free, settings, nullptr);
    const double error = fit.effect_standard_errors[0];
    EXPECT_LT(error, 0.25 * std::abs(value - null_value)) << id;
    EXPECT_NEAR(fit.parameters.effects[0].parameters[0], value, 0.7 * error) << id;
    // From where the null model has led, under its covariance.
    start.deviations = null.parameters.deviations;
    start.line_shift_px = null.parameters.line_shift_px;
    settings.rounds.clear();
    settings.max_iterations = 8;
    const FitResult near = FitSet(model, start, free, settings, &null);
    EXPECT_NEAR(near.parameters.effects[0].parameters[0], value, error) << id;
  }
}

TEST(UpdateDerivatives, FollowTheChangeThatWasSeenAndKeepZeros) {
  Eigen::MatrixXd jacobian(2, 3);
  jacobian << 1, 2, 0, 0, 0, 0;
  const Eigen::Vector3d moves(0.5, -1, 2);
  UpdateDerivatives(moves, Eigen::Vector2d(4, 7), jacobian);
  EXPECT_NEAR(jacobian.row(0).dot(moves), 4, 1e-12);
  EXPECT_EQ(jacobian(0, 2), 0);
  EXPECT_EQ(jacobian.row(1).norm(), 0);  // nothing it could follow by
  // Least change: along the moves that count.
  EXPECT_NEAR((jacobian(0, 0) - 1) / (jacobian(0, 1) - 2), 0.5 / -1, 1e-12);
}

// Fit of one deviation, three standard uncertainties off.
FitResult FitOfOneDeviation() {
  FitResult fit;
  fit.standardised = Eigen::VectorXd::Constant(1, 3);
  fit.prior_weight = Eigen::VectorXd::Ones(1);
  fit.residual = {Eigen::VectorXd::Constant(2, 5)};
  fit.jacobian = {Eigen::MatrixXd::Constant(2, 1, 10)};
  return fit;
}

TEST(LinearFit, WhatABoundHoldsAbsorbsNothing) {
  FitResult fit = FitOfOneDeviation();
  fit.at_bound = {false};
  const Eigen::VectorXd change = Eigen::VectorXd::Ones(2);
  EXPECT_LT(LinearFit(fit).Inner(change, change), 0.02);
  EXPECT_NE(LinearFit(fit).Step()[0], 0);
  fit.at_bound = {true};
  EXPECT_DOUBLE_EQ(LinearFit(fit).Inner(change, change), 2);
  EXPECT_EQ(LinearFit(fit).Step()[0], 0);
}

// An effect may take over from a deviation at its bound: the residual is that of
// the best deviation, at which nothing pulls.
TEST(LinearFit, WhatIsReleasedGoesToItsBest) {
  FitResult fit = FitOfOneDeviation();
  const LinearFit released(fit);
  const double best = 3 + released.Step()[0];
  EXPECT_NEAR(fit.jacobian[0].col(0).dot(released.ResidualAtBest()), best, 1e-9);
  fit.at_bound = {true};
  EXPECT_EQ(LinearFit(fit).ResidualAtBest(), fit.residual[0]);
}

TEST(ChiSquaredPValue, KnownValues) {
  EXPECT_NEAR(ChiSquaredPValue(3.841, 1), 0.05, 1e-4);
  EXPECT_NEAR(ChiSquaredPValue(18.307, 10), 0.05, 1e-4);
}

TEST(HeldOutRecordings, AQuarterAndTheSameForTheSameSeed) {
  const RecordedSet set = MakeRecordedSet(SmallSetDescription(), {});
  const std::vector<bool> held_out = HeldOutRecordings(set, 3);
  EXPECT_EQ(held_out, HeldOutRecordings(set, 3));
  int count = 0;
  for (bool out : held_out) count += out;
  EXPECT_GE(count, 2);
  EXPECT_LE(count, 6);
}

}  // namespace
}  // namespace sightline
