// SPDX-License-Identifier: Apache-2.0
// A named model is tested along discrepancies that it lacks.
#include "render_worker/diagnosis/selection/terms/directed_test.h"

#include <gtest/gtest.h>

#include <functional>
#include <vector>

#include "render_worker/effects/discrepancy/free_form.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

const ActiveEffect& TrueGlare() {
  static const ActiveEffect glare = [] {
    ActiveEffect active = AtNullValues(*FindEffect("optics.veiling_glare"));
    active.parameters[0] = 0.1;
    return active;
  }();
  return glare;
}

// Plain and directed p-values of veiling glare fitted to a set that has it and `also`.
struct PValues {
  double plain = 0, directed = 0;
};
PValues TestGlareIn(const std::vector<ActiveEffect>& also, uint64_t seed) {
  std::vector<ActiveEffect> effects = {TrueGlare()};
  effects.insert(effects.end(), also.begin(), also.end());
  const RecordedSet set = RenderSmallSet(SomeDeviations(), effects, seed);
  const SetModel model(set, {});
  ComparisonSettings settings;
  settings.free_forms = FreeFormTerms();
  const std::function<bool(double)> go_on = [](double) { return true; };
  const Context context = MakeContext(model, FitNull(model), settings, go_on);
  Hypothesis named = FitFromNominal(context, MakeHypothesis({TrueGlare()}));
  return {CheckHypothesis(context, named).p_value, TestAlongTerms(context, named).p_value};
}

TEST(TestAlongTerms, DoesNotRejectTheTrueEffect) { EXPECT_GT(TestGlareIn({}, 71).directed, 0.01); }

TEST(TestAlongTerms, FindsWhatATestOverAllNumbersMisses) {
  ActiveEffect cells = AtNullValues(*FindFreeFormTerm("unknown.cell_gain"));
  cells.parameters[0] = 0.01;
  const PValues found = TestGlareIn({cells}, 72);
  EXPECT_LT(found.directed, 1e-3) << "over all numbers: " << found.plain;
  EXPECT_LT(found.directed, found.plain);
}

}  // namespace
}  // namespace sightline
