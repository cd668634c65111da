// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/correction/rendered_correction.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "render_worker/diagnosis/fit/model_error.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

// Glare that spreads a tenth of the light.
std::vector<ActiveEffect> StrongGlare() { return {{FindEffect("optics.veiling_glare"), {0.1}}}; }

bool Always() { return true; }

TEST(RenderStatistics, HaveTheSizesOfTheRecordings) {
  // Bins and pixels depend on how bright images are, so these recordings are brighter.
  SetupDeviation brighter = SomeDeviations();
  brighter.power_relative = 0.3;
  const RecordedSet set = RenderSmallSet(brighter, StrongGlare(), 3);
  const SetModel model(set, {});
  const auto rendered = RenderStatistics(model, {}, {.renderings = 2, .seed = 9}, Always);
  ASSERT_TRUE(rendered.ok()) << rendered.status();
  ASSERT_EQ(rendered->size(), 2);
  for (const BlockVectors& one : *rendered) {
    ASSERT_EQ(one.size(), model.observed().size());
    for (size_t e = 0; e < one.size(); ++e) {
      EXPECT_EQ(one[e].size(), model.observed()[e].size()) << model.StatisticOf(e).name();
      EXPECT_TRUE(one[e].allFinite()) << model.StatisticOf(e).name();
    }
  }
}

TEST(RenderStatistics, OfTheRecordingsThemselvesAreTheObservedOnes) {
  const RecordedSet set = RenderSmallSet(SomeDeviations(), {}, 4);
  const SetModel model(set, {});
  const BlockVectors again = model.StatisticsOf(set);
  for (size_t e = 0; e < again.size(); ++e) EXPECT_EQ(again[e], model.observed()[e]);
}

TEST(RenderStatistics, StopsWhenAsked) {
  const RecordedSet set = RenderSmallSet({}, {}, 5);
  const SetModel model(set, {});
  int asked = 0;
  const auto rendered = RenderStatistics(model, {}, {}, [&] { return ++asked < 3; });
  EXPECT_TRUE(absl::IsCancelled(rendered.status()));
  EXPECT_EQ(asked, 3);
}

class Correction : public testing::Test {
 protected:
  void SetUp() override {
    truth_.effects = StrongGlare();
    fit_.parameters = truth_;
    fit_.mean = model_.Expect(truth_, false).mean;
    null_.mean = model_.Expect({}, false).mean;
    auto rendered = RenderStatistics(model_, truth_, {.renderings = 3, .seed = 21}, Always);
    ASSERT_TRUE(rendered.ok()) << rendered.status();
    rendered_ = *std::move(rendered);
  }

  const RecordedSet set_ = RenderSmallSet({}, StrongGlare(), 6);
  const SetModel model_{set_, {}};
  SetParameters truth_;
  FitResult fit_, null_;
  std::vector<BlockVectors> rendered_;
};

TEST_F(Correction, MakesTheExpectationTheMeanOfTheRenderings) {
  const SetModel corrected(model_, CorrectionOf(model_, fit_, null_, rendered_));
  EXPECT_TRUE(corrected.is_corrected());
  EXPECT_FALSE(model_.is_corrected());
  const BlockVectors mean = corrected.Expect(truth_, false).mean;
  for (size_t e = 0; e < mean.size(); ++e) {
    const Eigen::VectorXd rendered = (rendered_[0][e] + rendered_[1][e] + rendered_[2][e]) / 3;
    EXPECT_LT((mean[e] - rendered).norm(), 1e-9 * (1 + rendered.norm()));
  }
}

// Recordings with other seeds follow the corrected expectation at the truth.
TEST_F(Correction, LeavesNoExcessAtTheTruth) {
  const SetModel corrected(model_, CorrectionOf(model_, fit_, null_, rendered_));
  double squares = 0;
  int count = 0;
  const SetModel::Expectation exact = corrected.Expect(truth_, true);
  for (size_t e = 0; e < exact.mean.size(); ++e) {
    const Eigen::LLT<Eigen::MatrixXd> factor(exact.covariance[e]);
    const Eigen::VectorXd& observed = model_.observed()[e];
    squares += factor.matrixL().solve(observed - exact.mean[e]).squaredNorm();
    count += static_cast<int>(observed.size());
  }
  EXPECT_LT(squares, 1.1 * count);
}

// Both parts of the covariance are positive semidefinite, and the change's error is in it.
TEST_F(Correction, WidensTheCovarianceByTheErrorOfTheChange) {
  const ExpectationCorrection correction = CorrectionOf(model_, fit_, null_, rendered_);
  for (size_t e = 0; e < correction.covariance.size(); ++e) {
    const Eigen::VectorXd change = fit_.mean[e] - null_.mean[e];
    const double least = kEffectError * kEffectError * change.squaredNorm() * change.squaredNorm();
    EXPECT_GE(change.dot(correction.covariance[e] * change), least * (1 - 1e-9));
  }
}

}  // namespace
}  // namespace sightline
