// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/screening/fringe_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/expectation/expected_frame.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

const Effect& Etalon() { return *FindEffect("optics.cover_glass_etalon"); }

ActiveEffect Fringes(std::vector<double> parameters) { return {&Etalon(), std::move(parameters)}; }

// A bug found: fringes as long as a block of the line were texture of the plate, since their phase
// counted as unknown.
TEST(FringesSeen, HaveTheirPeriodDirectionAndPhase) {
  const std::vector<double> truth = {0.15, 60, 35, 50};
  const RecordedSet set = RenderSmallSet({}, {Fringes(truth)}, 3);
  const std::vector<ActiveEffect> seen = FringesSeen(Etalon(), set);
  ASSERT_FALSE(seen.empty());
  const std::vector<double>& found = seen[0].parameters;
  EXPECT_NEAR(found[0], truth[0], 0.05);
  // A tenth of a turn over the columns; the line covers fewer rows.
  EXPECT_NEAR(std::cos(found[2] * kRadians) / found[1], std::cos(truth[2] * kRadians) / truth[1],
              0.1 / 192);
  EXPECT_NEAR(std::sin(found[2] * kRadians) / found[1], std::sin(truth[2] * kRadians) / truth[1],
              0.25 / 40);
  // The phase is beyond that drawn for the camera.
  const std::vector<ActiveEffect> turned = FringesSeen(
      Etalon(), RenderSmallSet({}, {Fringes({truth[0], truth[1], truth[2], truth[3] + 80})}, 3));
  ASSERT_FALSE(turned.empty());
  EXPECT_NEAR(std::cos((turned[0].parameters[3] - found[3] - 80) * kRadians), 1, 0.05);
}

TEST(FringesSeen, NothingRecordedShowsNothing) {
  const RecordedSet planned = MakeRecordedSet(SmallSetDescription(), {});
  EXPECT_TRUE(FringesSeen(Etalon(), planned).empty());
}

TEST(ExpectFrame, FringesAreTheMeanOfTheColumnsOfABlock) {
  const RecordedSet planned = MakeRecordedSet(SmallSetDescription(), {});
  constexpr int kColumns = 48;
  for (const double period_px : {9.0, 40.0, 300.0}) {
    const std::vector<ActiveEffect> fringes = {Fringes({0.3, period_px, 25, 0})};
    FrameSetup strip = planned.frames[0].nominal;
    strip.roi.columns_px = 2;
    const ExpectedFrame block = ExpectFrame(strip, fringes, nullptr, nullptr, 4, kColumns);
    Image<double> mean(1, strip.roi.rows_px, 0.0);
    const int first = strip.roi.column_px + (strip.roi.columns_px - kColumns) / 2;
    for (int c = 0; c < kColumns; ++c) {
      FrameSetup column = strip;
      column.roi.column_px = first + c;
      column.roi.columns_px = 1;
      const ExpectedFrame of_column = ExpectFrame(column, fringes, nullptr, nullptr, 4);
      for (int row = 0; row < strip.roi.rows_px; ++row) {
        mean.At(row, 0) += of_column.MeanDn(row, 0) / kColumns;
      }
    }
    const double top = *std::max_element(mean.values.begin(), mean.values.end());
    for (int row = 0; row < strip.roi.rows_px; ++row) {
      EXPECT_NEAR(block.MeanDn(row, 0), mean.At(row, 0), 0.01 * top) << period_px << " " << row;
    }
  }
}

}  // namespace
}  // namespace sightline
