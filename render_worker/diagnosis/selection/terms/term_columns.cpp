// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/terms/term_columns.h"

#include <algorithm>
#include <utility>

#include "render_worker/diagnosis/random_effect/compare_random_effects.h"
#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/thresholds.h"

namespace sightline {

std::vector<TermColumn> TermColumnsOf(const Context& context, const SetParameters& about,
                                      Stage stage) {
  std::vector<TermColumn> columns;
  for (const Effect* term : context.settings.free_forms) {
    if (term->description().stage != stage || HasRandomLaw(*term)) continue;
    const std::vector<EffectParameter>& parameters = term->description().parameters;
    for (size_t i = 0; i < parameters.size(); ++i) {
      ActiveEffect active = AtNullValues(*term);
      active.parameters[i] = ParameterFromStandardised(parameters[i], thresholds::kTermProbe);
      SetParameters moved = about;
      moved.effects.push_back(std::move(active));
      BlockVectors mean = context.model.Expect(moved, false).mean;
      const bool finite = std::all_of(
          mean.begin(), mean.end(), [](const Eigen::VectorXd& block) { return block.allFinite(); });
      if (finite) columns.push_back({term, i, std::move(mean)});
    }
  }
  return columns;
}

std::vector<const Effect*> TermsOf(const std::vector<TermColumn>& columns) {
  std::vector<const Effect*> terms;
  for (const TermColumn& column : columns) {
    if (terms.empty() || terms.back() != column.term) terms.push_back(column.term);
  }
  return terms;
}

}  // namespace sightline
