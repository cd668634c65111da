// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/fit/linear_fit.h"
#include "render_worker/diagnosis/random_effect/compare_random_effects.h"
#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/term_selection.h"
#include "render_worker/diagnosis/selection/terms/term_columns.h"
#include "render_worker/diagnosis/selection/thresholds.h"

namespace sightline {
namespace {

// Columns of one stage about a fit, after the set-up's parameters have absorbed what they can.
struct Gram {
  std::vector<TermColumn> columns;
  Eigen::MatrixXd information;  // inner products
  Eigen::VectorXd gradient;     // with the residual
};

Gram GramOf(const Context& context, const LinearFit& linear, const SetParameters& about,
            Stage stage) {
  Gram gram{TermColumnsOf(context, about, stage), {}, {}};
  const auto n = static_cast<Eigen::Index>(gram.columns.size());
  Eigen::MatrixXd changes(linear.residual().size(), n), projected = changes;
  for (Eigen::Index i = 0; i < n; ++i) {
    changes.col(i) =
        linear.Change(gram.columns[static_cast<size_t>(i)].mean) / thresholds::kTermProbe;
    projected.col(i) = linear.Project(changes.col(i));
  }
  gram.information = changes.transpose() * projected;
  gram.gradient = changes.transpose() * linear.residual();
  return gram;
}

// Coefficients chosen, and their evidence in the linearised model.
struct Choice {
  std::vector<int> chosen;
  Eigen::VectorXd standardised;
  double log_evidence = 0;  // over no coefficient, without the prior of the choice [nats]
};

// The optimum for `chosen` with a standard normal prior on each, and its evidence with
// LogParameterPrior in the place of that prior.
Choice Evaluate(const Gram& gram, std::vector<int> chosen) {
  const auto n = static_cast<Eigen::Index>(chosen.size());
  Eigen::MatrixXd information = gram.information(chosen, chosen);
  information += Eigen::MatrixXd::Identity(n, n);
  const Eigen::LLT<Eigen::MatrixXd> factor(information);
  const Eigen::VectorXd gradient = gram.gradient(chosen);
  Choice choice{std::move(chosen), factor.solve(gradient), 0};
  const Eigen::MatrixXd covariance = factor.solve(Eigen::MatrixXd::Identity(n, n));
  choice.log_evidence =
      0.5 * (choice.standardised.dot(gradient) + choice.standardised.squaredNorm()) -
      factor.matrixLLT().diagonal().array().log().sum();
  for (Eigen::Index k = 0; k < n; ++k) {
    const TermColumn& column = gram.columns[static_cast<size_t>(choice.chosen[k])];
    choice.log_evidence +=
        LogParameterPrior(column.term->description().parameters[column.coefficient],
                          choice.standardised[k], std::sqrt(covariance(k, k)));
  }
  return choice;
}

// Adds the coefficient of largest evidence while that pays for the choice among all columns.
Choice ChooseForward(const Gram& gram) {
  Choice best;
  const double cost = std::log(std::max<double>(1, static_cast<double>(gram.columns.size())));
  while (best.chosen.size() < thresholds::kStageCoefficients) {
    std::optional<Choice> next;
    for (int k = 0; k < static_cast<int>(gram.columns.size()); ++k) {
      if (gram.information(k, k) < thresholds::kAbsorbed ||
          std::find(best.chosen.begin(), best.chosen.end(), k) != best.chosen.end()) {
        continue;
      }
      std::vector<int> chosen = best.chosen;
      chosen.push_back(k);
      Choice choice = Evaluate(gram, std::move(chosen));
      if (!next || choice.log_evidence > next->log_evidence) next = std::move(choice);
    }
    if (!next || !(next->log_evidence - best.log_evidence > cost)) break;
    best = *std::move(next);
  }
  return best;
}

// `base` with the chosen coefficients, not fitted.
Hypothesis WithColumns(const Hypothesis& base, const Gram& gram, const Choice& choice) {
  Hypothesis hypothesis = base;
  for (const Effect* term : TermsOf(gram.columns)) {
    const auto e = static_cast<int>(hypothesis.effects.size());
    bool used = false;
    ActiveEffect active = AtNullValues(*term);
    for (size_t k = 0; k < choice.chosen.size(); ++k) {
      const TermColumn& column = gram.columns[static_cast<size_t>(choice.chosen[k])];
      if (column.term != term) continue;
      const EffectParameter& parameter = term->description().parameters[column.coefficient];
      active.parameters[column.coefficient] =
          ParameterFromStandardised(parameter, choice.standardised[static_cast<Eigen::Index>(k)]);
      hypothesis.free.push_back({e, static_cast<int>(column.coefficient)});
      used = true;
    }
    if (used) hypothesis.effects.push_back(std::move(active));
  }
  std::stable_sort(hypothesis.free.begin(), hypothesis.free.end(),
                   [](const auto& a, const auto& b) {
                     return a.effect != b.effect ? a.effect < b.effect : a.parameter < b.parameter;
                   });
  return hypothesis;
}

struct Candidate {
  Hypothesis hypothesis;
  const FitResult* reference;
  double expected_log_evidence;
};

}  // namespace

StageResult AddStageDiscrepancies(const Context& context, std::vector<Hypothesis> hypotheses) {
  if (hypotheses.empty()) return {std::move(hypotheses)};
  const bool term_leads = IsFreeForm(hypotheses.front()) &&
                          hypotheses.front().log_evidence > thresholds::kPromising_nats;
  const bool rejected = NullIsRejected(context) && NamedIsRejected(context, hypotheses);
  if (!term_leads && !rejected) return {std::move(hypotheses)};
  std::vector<Hypothesis> bases(1);
  bases[0].fit = context.null;
  if (const Hypothesis* single = BestSingle(hypotheses)) bases.push_back(*single);
  std::vector<Candidate> candidates;
  for (const Hypothesis& base : bases) {
    const LinearFit linear(base.fit);
    for (const Stage stage : kStages) {
      if (!context.proceed(thresholds::kStageDiscrepancyDone)) return {std::move(hypotheses), true};
      const Gram gram = GramOf(context, linear, base.fit.parameters, stage);
      const Choice choice = ChooseForward(gram);
      Hypothesis with = WithColumns(base, gram, choice);
      // One term by itself has been fitted already.
      if (with.effects.size() < base.effects.size() + 2) continue;
      candidates.push_back({std::move(with), &base.fit, base.log_evidence + choice.log_evidence});
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) {
    return a.expected_log_evidence > b.expected_log_evidence;
  });
  if (candidates.size() > thresholds::kStageFits) candidates.resize(thresholds::kStageFits);
  for (Candidate& candidate : candidates) {
    if (!context.proceed(thresholds::kStageDiscrepancyDone)) return {std::move(hypotheses), true};
    hypotheses.push_back(
        FitHypothesis(context, std::move(candidate.hypothesis), *candidate.reference, {false, 8}));
  }
  return {SortedByEvidence(std::move(hypotheses))};
}

}  // namespace sightline
