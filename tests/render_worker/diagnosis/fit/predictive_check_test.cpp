// SPDX-License-Identifier: Apache-2.0
// Models that are true predict recordings that were not fitted, others do not.
#include "render_worker/diagnosis/fit/predictive_check.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <memory>
#include <string_view>
#include <vector>

#include "core/random/counter_random.h"
#include "render_worker/diagnosis/fit/fit_quality.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

TEST(CheckPredictions, ATrueModelIsNotRejectedAndAnotherIs) {
  const RecordedSet right = RenderSmallSet({}, {}, 23);
  const SetModel model(right, {});
  const FitResult null = FitNull(model);
  const PredictiveCheck check = CheckPredictions(model, null, null, 1);
  EXPECT_GT(check.p_value, 0.05);
  EXPECT_GT(check.groups.size(), 5);

  RecordedSet wrong = right;
  FailInReciprocity(&wrong);
  const SetModel wrong_model(wrong, {});
  const FitResult wrong_null = FitNull(wrong_model);
  const PredictiveCheck rejected = CheckPredictions(wrong_model, wrong_null, wrong_null, 1);
  EXPECT_LT(rejected.p_value, 1e-6);
}

TEST(CheckPredictions, IsTheSameForTheSameSeedAndGroupsHoldAllNumbersOfTheirKind) {
  const RecordedSet set = RenderSmallSet({}, {}, 29);
  const SetModel model(set, {});
  const FitResult null = FitNull(model);
  const PredictiveCheck once = CheckPredictions(model, null, null, 7);
  const PredictiveCheck again = CheckPredictions(model, null, null, 7);
  EXPECT_EQ(once.log_score, again.log_score);
  int profile = 0, of_all_apertures = 0;
  for (const PredictedGroup& group : once.groups) {
    EXPECT_GT(group.degrees_of_freedom, 0) << group.name;
    if (group.name == "profile") profile = group.degrees_of_freedom;
    if (group.name.starts_with("f_number")) of_all_apertures += group.degrees_of_freedom;
  }
  EXPECT_GT(profile, 0);
  // Profiles are of one recording each, so they have one f-number.
  EXPECT_GE(of_all_apertures, profile);
}

const PredictedGroup& GroupOf(const PredictiveCheck& check, std::string_view name) {
  const auto found = std::find_if(check.groups.begin(), check.groups.end(),
                                  [&](const PredictedGroup& group) { return group.name == name; });
  EXPECT_NE(found, check.groups.end()) << name;
  return *found;
}

// A check of the null model of a set, and one of the model with the effect sensor.prnu fitted.
struct ComparedChecks {
  PredictiveCheck null, with;
};

ComparedChecks CheckPrnu(const RecordedSet& set) {
  const SetModel model(set, {});
  const FitResult null = FitNull(model);
  SetParameters start = null.parameters;
  start.effects = {{FindEffect("sensor.prnu"), {0.05}}};  // at 0 the derivative is 0
  FitSettings settings;
  settings.rounds = {{0, 0}, {0, 0}};
  const FitResult with = FitSet(model, start, FreeParameters(start.effects), settings, &null);
  return {CheckPredictions(model, null, null, 1), CheckPredictions(model, with, null, 1)};
}

// Regression: the fixed pattern of all recordings together was neither used nor held out.
TEST(CheckPredictions, APixelPatternPredictsOtherPixels) {
  // Weaker patterns of so few pixels gain less than they widen the covariances of all statistics.
  const ComparedChecks checks =
      CheckPrnu(RenderSmallSet({}, {{FindEffect("sensor.prnu"), {0.2}}}, 31));
  EXPECT_GT(checks.with.log_score - checks.null.log_score, 3);
  const PredictedGroup& null = GroupOf(checks.null, "fixed pattern");
  const PredictedGroup& with = GroupOf(checks.with, "fixed pattern");
  EXPECT_GT(null.chi_squared - with.chi_squared, 2 * 3);
  // Six products of the recordings with laser in each of four folds. Of the three dark frames, one
  // is held out in each of three folds, and two products are predicted.
  EXPECT_EQ(null.degrees_of_freedom, 4 * 6 + 3 * 2);
  EXPECT_EQ(with.degrees_of_freedom, null.degrees_of_freedom);
}

TEST(CheckPredictions, APatternThatIsNotThereGainsNothing) {
  const ComparedChecks checks = CheckPrnu(RenderSmallSet({}, {}, 23));
  EXPECT_LT(checks.with.log_score - checks.null.log_score, 3);
  EXPECT_GT(GroupOf(checks.null, "fixed pattern").p_value, 0.001);
}

// Gaussian data y = mean + G (z - x) + noise of a linear model with parameters z ~ N(0, W^-1).
struct LinearData {
  Eigen::VectorXd deviation;  // y - mean
  Eigen::MatrixXd jacobian;   // G
  Eigen::MatrixXd covariance;
};

Eigen::MatrixXd DrawMatrix(Eigen::Index rows, Eigen::Index columns, CounterRandom& random) {
  Eigen::MatrixXd matrix(rows, columns);
  for (double& value : matrix.reshaped()) value = random.Normal();
  return matrix;
}

LinearData DrawData(Eigen::Index size, Eigen::Index parameters, CounterRandom& random) {
  const Eigen::MatrixXd factor = DrawMatrix(size, size, random);
  return {3 * DrawMatrix(size, 1, random), DrawMatrix(size, parameters, random),
          factor * factor.transpose() + Eigen::MatrixXd::Identity(size, size)};
}

// Log density of all data together without the term of 2 pi, by their dense covariance.
double LogDensity(const std::vector<LinearData>& all, const FitResult& fit) {
  Eigen::Index size = 0;
  for (const LinearData& data : all) size += data.deviation.size();
  Eigen::VectorXd deviation(size);
  Eigen::MatrixXd jacobian(size, fit.standardised.size());
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(size, size);
  Eigen::Index at = 0;
  for (const LinearData& data : all) {
    const Eigen::Index n = data.deviation.size();
    deviation.segment(at, n) = data.deviation + data.jacobian * fit.standardised;
    jacobian.middleRows(at, n) = data.jacobian;
    covariance.block(at, at, n, n) = data.covariance;
    at += n;
  }
  covariance += jacobian * fit.prior_weight.cwiseInverse().asDiagonal() * jacobian.transpose();
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  return -0.5 * (factor.matrixL().solve(deviation).squaredNorm() +
                 2 * factor.matrixLLT().diagonal().array().log().sum());
}

TEST(DivideBlock, ScoreIsThePredictiveDensityOfALinearModel) {
  constexpr Eigen::Index kParameters = 3, kLeading = 2;
  CounterRandom random(5, 0);
  // A block that is used, one that is held out, and one of four components that is divided.
  const std::vector<LinearData> blocks = {DrawData(3, kParameters, random),
                                          DrawData(2, kParameters, random),
                                          DrawData(4, kParameters, random)};
  FitResult fit;
  fit.standardised = DrawMatrix(kParameters, 1, random);
  fit.prior_weight = Eigen::Vector3d(1, 1, 0.5);
  fit.at_bound.assign(kParameters, false);
  std::vector<Eigen::MatrixXd> covariance;
  for (const LinearData& block : blocks) covariance.push_back(block.covariance);
  fit.whitening = std::make_shared<const Whitening>(covariance, BlockVectors());
  for (int e = 0; e < 3; ++e) {
    const LinearData& block = blocks[static_cast<size_t>(e)];
    fit.residual.push_back((*fit.whitening)(e, block.deviation));
    Eigen::MatrixXd jacobian = block.jacobian;
    for (Eigen::Index j = 0; j < kParameters; ++j) {
      jacobian.col(j) = (*fit.whitening)(e, block.jacobian.col(j));
    }
    fit.jacobian.push_back(jacobian);
  }
  const Eigen::VectorXd mean = DrawMatrix(4, 1, random);
  BlockVectors parts;
  std::vector<LinearData> of_parts;
  for (int k = 0; k < kObservedParts; ++k) {
    of_parts.push_back({3 * DrawMatrix(kLeading, 1, random), blocks[2].jacobian.topRows(kLeading),
                        kObservedParts * covariance[2].topLeftCorner(kLeading, kLeading)});
    parts.push_back(mean.head(kLeading) + of_parts.back().deviation);
  }
  double score = 0, exact = 0;
  for (int fold = 0; fold < kObservedParts; ++fold) {
    const DividedBlock divided = DivideBlock(fit, 2, mean + blocks[2].deviation, parts, fold);
    const Prediction prediction(fit, {true, false, false}, {divided});
    Prediction::Sum sum;
    prediction.Add(1, &sum);
    prediction.Add(divided.held_out, &sum);
    EXPECT_EQ(sum.numbers, 2 + kLeading);
    score -= 0.5 * (prediction.ChiSquared(sum) + prediction.LogDeterminant(sum) +
                    fit.whitening->LogDeterminant(1) + divided.log_determinant);
    std::vector<LinearData> used = {blocks[0]};
    for (int k = 0; k < kObservedParts; ++k) {
      if (k != fold) used.push_back(of_parts[static_cast<size_t>(k)]);
    }
    std::vector<LinearData> all = used;
    all.push_back(blocks[1]);
    all.push_back(of_parts[static_cast<size_t>(fold)]);
    exact += LogDensity(all, fit) - LogDensity(used, fit);
  }
  EXPECT_NEAR(score, exact, 1e-9 * std::abs(exact));
}

}  // namespace
}  // namespace sightline
