// SPDX-License-Identifier: Apache-2.0
// Covariances of profiles; hot pixels.
#include "render_worker/diagnosis/statistic/profile_statistic.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/diagnose.h"
#include "render_worker/diagnosis/statistic/hot_pixels.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

// Regression: correlations composed of positions with different speckle were not positive definite.
TEST(ProfileStatistic, CovarianceIsPositiveOutOfFocus) {
  RecordingSet description = SmallSetDescription();
  for (RecordedImage& image : description.recordings) {
    image.f_number = 2;
    image.camera_distance_m = 0.25;
  }
  const RecordedSet set = MakeRecordedSet(description, {});
  const SetModel model(set, {});
  const SetModel::Expectation expectation = model.Expect({}, true);
  for (int e = 0; e < model.blocks(); ++e) {
    if (model.StatisticOf(e).kind() != StatisticKind::kProfile) continue;
    const Eigen::VectorXd deviation = expectation.covariance[e].diagonal().cwiseSqrt();
    const Eigen::MatrixXd correlation = deviation.cwiseInverse().asDiagonal() *
                                        expectation.covariance[e] *
                                        deviation.cwiseInverse().asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(correlation);
    EXPECT_GT(solver.eigenvalues().minCoeff(), 1e-3) << e;
  }
}

// Regression: the uncertainty of the signal at the region's edge was lost where no bin lay at the
// distance at which it is read.
TEST(ProfileStatistic, TailsAreUncertainWhateverTheBins) {
  for (const double f_number : {1.4, 2.8, 8.0}) {
    for (const double distance_m : {0.28, 0.31, 0.33}) {
      RecordingSet description = SmallSetDescription();
      for (RecordedImage& image : description.recordings) {
        image.f_number = f_number;
        image.camera_distance_m = distance_m;
      }
      const RecordedSet set = MakeRecordedSet(description, {});
      const SetModel model(set, {});
      SetParameters more;
      more.model_error.standardised = {1, 1, 0};
      const SetModel::Expectation nominal = model.Expect({}, false);
      const SetModel::Expectation raised = model.Expect(more, false);
      for (int e = 0; e < model.blocks(); ++e) {
        if (model.StatisticOf(e).kind() != StatisticKind::kProfile || nominal.mean[e].size() < 10)
          continue;
        EXPECT_GT((raised.mean[e] - nominal.mean[e]).minCoeff(), 0) << f_number << " " << e;
      }
    }
  }
}

// A bug found: a few hot pixels spoiled every variance, and another effect was named.
TEST(WithoutHotPixels, ReplacesThemEverywhereAndNothingElse) {
  const RecordingSet description = SmallSetDescription();
  std::vector<Image<uint16_t>> images;
  for (const RecordedImage& recording : description.recordings) {
    Image<uint16_t> image(recording.roi_columns_px, recording.roi_rows_px);
    for (size_t i = 0; i < image.values.size(); ++i) {
      image.values[i] = static_cast<uint16_t>(20 + (i * 7919) % 5);
    }
    images.push_back(std::move(image));
  }
  const Image<uint16_t> before = images.front();
  images.back().At(60, 50) = 700;  // seen in a dark frame, lies on the line of the others
  images.front().At(60, 50) = 400;
  images.front().At(62, 90) = images.front().At(62, 91) = 400;  // on the line: may be speckle
  const RecordedSet cleaned = WithoutHotPixels(MakeRecordedSet(description, images));
  EXPECT_LE(cleaned.frames.back().raw_dn.At(60, 50), 25);
  EXPECT_LE(cleaned.frames.front().raw_dn.At(60, 50), 25);
  EXPECT_EQ(cleaned.frames.front().raw_dn.At(62, 90), 400);
  int changed = 0;
  for (size_t i = 0; i < before.values.size(); ++i) {
    changed += cleaned.frames.front().raw_dn.values[i] != images.front().values[i];
  }
  EXPECT_EQ(changed, 1);
}

}  // namespace
}  // namespace sightline
