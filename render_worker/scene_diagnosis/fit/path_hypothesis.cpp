// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/fit/path_hypothesis.h"

#include "absl/strings/str_join.h"

namespace sightline {

std::string PathHypothesis::Name() const {
  return effects.empty() ? "none" : absl::StrJoin(effects, " + ");
}

Evidence PathHypothesis::Terms() const {
  Evidence terms = best.evidence;
  terms.fit += best.held_out.fit;
  terms.covariance += best.held_out.covariance;
  terms.parameter_prior += log_predictive - best.LogPredictive();
  terms.model_prior = log_prior;
  return terms;
}

}  // namespace sightline
