// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/transfer/transfer_score.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "render_worker/sensor/expose.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

class Transfer : public testing::Test {
 protected:
  // Change of every profile by the signal times a function of its recording.
  BlockVectors SignalTimes(const std::function<double(const FrameSetup&)>& factor) const {
    BlockVectors change;
    for (int e = 0; e < model_.blocks(); ++e) {
      Eigen::VectorXd block = Eigen::VectorXd::Zero(null_.mean[e].size());
      if (model_.StatisticOf(e).kind() == StatisticKind::kProfile) {
        for (Eigen::Index k = 0; k < block.size(); ++k) {
          const FrameSetup& frame =
              set_.frames[model_.FrameOfComponent(e, static_cast<int>(k))].nominal;
          block[k] = (null_.mean[e][k] - DarkMeanDn(frame.sensor)) * factor(frame);
        }
      }
      change.push_back(block);
    }
    return change;
  }

  // The null model that lacks `change`.
  FitResult Lacking(const BlockVectors& change) const {
    FitResult base = null_;
    for (size_t e = 0; e < change.size(); ++e) base.mean[e] -= change[e];
    return base;
  }

  const RecordedSet set_ = RenderSmallSet(SomeDeviations(), {}, 31);
  const SetModel model_{set_, {}};
  const FitResult null_ = FitNull(model_);
  const std::vector<SettingSplit> splits_ = SplitBySettings(model_);
  const BlockVectors by_exposure_ =
      SignalTimes([](const FrameSetup& f) { return std::log(f.exposure_time_s / 1e-3); });
  const BlockVectors by_distance_ =
      SignalTimes([](const FrameSetup& f) { return f.plate.camera_distance_m / 0.33 - 1; });
};

TEST_F(Transfer, EverySettingThatVariesIsSplit) {
  std::vector<std::string> names;
  for (const SettingSplit& split : splits_) names.push_back(split.setting);
  EXPECT_THAT(names, testing::ElementsAre("exposure_time_s", "f_number", "camera_distance_m",
                                          "plate position", "time", "pixels"));
}

TEST_F(Transfer, RecordingsWithOneValueAreHeldOutTogetherAndOnce) {
  const auto split = std::find_if(splits_.begin(), splits_.end(), [](const SettingSplit& each) {
    return each.setting == "f_number";
  });
  for (int e = 0; e < model_.blocks(); ++e) {
    for (int k = 0; k < static_cast<int>(model_.observed()[e].size()); ++k) {
      const RecordedFrame& recorded = set_.frames[model_.FrameOfComponent(e, k)];
      const bool first = split->held_out[0][e][k], second = split->held_out[1][e][k];
      EXPECT_FALSE(first && second);
      // Dark frames say nothing about the f-number.
      EXPECT_EQ(first || second, recorded.plate_position_id >= 0);
      const double n = recorded.nominal.lens.f_number;
      if (recorded.plate_position_id >= 0) {
        EXPECT_EQ(second, n == 4.0 || n == 8.0) << n;
      }
    }
  }
}

TEST_F(Transfer, FunctionOfTheExposurePredictsADiscrepancyThatFollowsIt) {
  BlockVectors missing = by_exposure_;
  for (Eigen::VectorXd& block : missing) block *= 0.05;
  const std::vector<TransferScore> scores =
      ScoreTransfer(model_, Lacking(missing), splits_, {{}, {by_exposure_}, {by_distance_}});
  EXPECT_GT(scores[1].Total(), scores[0].Total() + 3);
  EXPECT_GT(scores[1].Total(), scores[2].Total() + 3);
  const ScoreDifference difference = Difference(scores[1], scores[2]);
  EXPECT_NEAR(difference.nats, scores[1].Total() - scores[2].Total(), 1e-9);
  EXPECT_GT(difference.standard_error, 0);
}

TEST_F(Transfer, NothingIsGainedWhereNothingIsMissing) {
  const std::vector<TransferScore> scores =
      ScoreTransfer(model_, null_, splits_, {{}, {by_exposure_}, {by_distance_}});
  EXPECT_LT(scores[1].Total(), scores[0].Total() + 3);
  EXPECT_LT(scores[2].Total(), scores[0].Total() + 3);
}

// Without columns and with the known parameters fixed, the score is the density of the held-out
// components given those used: whole blocks are held out by their plate position.
TEST_F(Transfer, ScoreIsTheConditionalDensity) {
  FitResult fixed = null_;
  fixed.standardised.setZero();
  for (Eigen::MatrixXd& jacobian : fixed.jacobian) jacobian.setZero();
  const auto split = std::find_if(splits_.begin(), splits_.end(), [](const SettingSplit& each) {
    return each.setting == "plate position";
  });
  const std::vector<TransferScore> scores = ScoreTransfer(model_, fixed, {*split}, {{}});
  double expected = 0;
  for (int e = 0; e < model_.blocks(); ++e) {
    const auto held_out = [&](const std::vector<std::vector<bool>>& half) {
      return std::all_of(half[e].begin(), half[e].end(), [](bool out) { return out; });
    };
    if (held_out(split->held_out[0]) || held_out(split->held_out[1])) {
      expected -= 0.5 * null_.residual[e].squaredNorm();
    }
  }
  EXPECT_NEAR(scores[0].Total(), expected, 1e-6 * std::abs(expected));
}

}  // namespace
}  // namespace sightline
