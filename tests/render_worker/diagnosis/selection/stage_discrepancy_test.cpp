// SPDX-License-Identifier: Apache-2.0
// Discrepancies of several terms of one stage.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <vector>

#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/effects/discrepancy/free_form.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

// The hypotheses added to the fit of dark current, which is in none of the sets.
std::vector<Hypothesis> AddedOn(const RecordedSet& set) {
  const SetModel model(set, {});
  ComparisonSettings settings;
  settings.free_forms = FreeFormTerms();
  const std::function<bool(double)> go_on = [](double) { return true; };
  const Context context = MakeContext(model, FitNull(model), settings, go_on);
  const ActiveEffect dark{FindEffect("sensor.dark_current"), {1}};
  const Hypothesis named = FitHypothesis(context, MakeHypothesis({dark}), context.null, {});
  std::vector<Hypothesis> added = AddStageDiscrepancies(context, {named}).hypotheses;
  std::erase_if(added, [](const Hypothesis& h) { return !IsFreeForm(h); });
  return added;
}

TEST(AddStageDiscrepancies, DescribesTwoDeparturesOfOneStageTogether) {
  ActiveEffect cells{FindFreeFormTerm("unknown.cell_gain"), {}};
  cells.parameters.assign(cells.effect->description().parameters.size(), 0);
  cells.parameters[0] = 0.04;
  const ActiveEffect response{FindFreeFormTerm("unknown.response_law"), {0.06, 0, 0}};
  const RecordedSet set = RenderSmallSet(SomeDeviations(), {cells, response}, 61);
  const SetModel model(set, {});
  const std::vector<Hypothesis> added = AddedOn(set);
  ASSERT_FALSE(added.empty());
  const Hypothesis& best = added.front();
  EXPECT_TRUE(Has(best, cells.effect));
  for (const ActiveEffect& active : best.effects) {
    EXPECT_EQ(active.effect->description().stage, Stage::kSensor)
        << active.effect->description().id;
  }
  const double null_excess = FitNull(model).chi_squared / FitNull(model).data_count;
  EXPECT_LT(best.fit.chi_squared / best.fit.data_count, 1.3) << "without: " << null_excess;
}

TEST(AddStageDiscrepancies, AddsNothingWhereNothingIsMissing) {
  EXPECT_TRUE(AddedOn(RenderSmallSet(SomeDeviations(), {}, 62)).empty());
}

}  // namespace
}  // namespace sightline
