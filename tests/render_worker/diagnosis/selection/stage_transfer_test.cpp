// SPDX-License-Identifier: Apache-2.0
// Stages located by the transfer of discrepancies between settings.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <vector>

#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/effects/discrepancy/free_form.h"
#include "render_worker/effects/stage_name.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

std::vector<StageTransfer> TransferOn(const RecordedSet& set) {
  const SetModel model(set, {});
  ComparisonSettings settings;
  settings.free_forms = FreeFormTerms();
  const std::function<bool(double)> go_on = [](double) { return true; };
  const Context context = MakeContext(model, FitNull(model), settings, go_on);
  std::vector<Hypothesis> hypotheses;
  for (const char* id : {"unknown.exposure", "unknown.response_law", "unknown.dark_signal",
                         "unknown.halo", "unknown.beam", "unknown.reflectance"}) {
    const Effect* term = FindFreeFormTerm(id);
    hypotheses.push_back(
        FitHypothesis(context, MakeHypothesis({AtNullValues(*term)}), context.null, {false, 8}));
  }
  return TransferOfStages(context, hypotheses);
}

TEST(TransferOfStages, LocatesADiscrepancyOfTheExposureInTime) {
  RecordedSet set = RenderSmallSet(SomeDeviations(), {}, 51);
  FailInReciprocity(&set);
  const std::vector<StageTransfer> transfer = TransferOn(set);
  ASSERT_EQ(transfer.size(), 6);
  EXPECT_THAT(StagesByTransfer(transfer), testing::Contains(Stage::kTime));
  EXPECT_EQ(transfer.front().behind, 0);
}

TEST(TransferOfStages, GainsLittleWhereNothingIsMissing) {
  for (const StageTransfer& stage : TransferOn(RenderSmallSet(SomeDeviations(), {}, 52))) {
    EXPECT_LT(stage.gain, 5) << StageName(stage.stage);
  }
}

TEST(StagesByTransfer, SaysAtMostTwoStagesAndNoneThatPredictsWorseThanTheNullModel) {
  using testing::ElementsAre;
  EXPECT_THAT(
      StagesByTransfer(
          {{Stage::kSensor, 30, 0, 0}, {Stage::kOptics, 28, 2, 1.5}, {Stage::kTime, 27, 3, 2}}),
      ElementsAre(Stage::kSensor, Stage::kOptics));
  EXPECT_THAT(StagesByTransfer({{Stage::kSensor, 30, 0, 0}, {Stage::kOptics, 10, 20, 3}}),
              ElementsAre(Stage::kSensor));
  EXPECT_THAT(StagesByTransfer({{Stage::kSensor, 2, 0, 0}, {Stage::kOptics, -1, 3, 3}}),
              ElementsAre(Stage::kSensor));
  EXPECT_THAT(StagesByTransfer({{Stage::kSensor, -1, 0, 0}}), testing::IsEmpty());
}

}  // namespace
}  // namespace sightline
