// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/terms/directed_test.h"

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "render_worker/diagnosis/fit/linear_fit.h"
#include "render_worker/diagnosis/fit/score_test.h"
#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/terms/term_columns.h"
#include "render_worker/diagnosis/selection/thresholds.h"
#include "render_worker/evidence/judgement.h"

namespace sightline {
namespace {

// One column of kEffectError times the whitened change for every observation block, since an error
// of the modelled effect is alike in all numbers of a block.
Eigen::MatrixXd ErrorOfChange(const Context& context, const FitResult& fit) {
  Eigen::Index numbers = 0;
  for (const Eigen::VectorXd& residual : fit.residual) numbers += residual.size();
  if (context.model.is_corrected()) return Eigen::MatrixXd(numbers, 0);
  const auto blocks = static_cast<Eigen::Index>(fit.mean.size());
  Eigen::MatrixXd error = Eigen::MatrixXd::Zero(numbers, blocks);
  Eigen::Index at = 0;
  for (Eigen::Index e = 0; e < blocks; ++e) {
    const auto index = static_cast<size_t>(e);
    const Eigen::Index n = fit.mean[index].size();
    error.col(e).segment(at, n) =
        kEffectError *
        (*fit.whitening)(static_cast<int>(e), fit.mean[index] - context.null.mean[index]);
    at += n;
  }
  return error;
}

// Whitened changes by one prior scale of each of the term's coefficients, in columns.
Eigen::MatrixXd ChangesBy(const Effect& term, const std::vector<TermColumn>& columns,
                          const LinearFit& linear) {
  Eigen::MatrixXd changes(linear.residual().size(), 0);
  for (const TermColumn& column : columns) {
    if (column.term != &term) continue;
    changes.conservativeResize(Eigen::NoChange, changes.cols() + 1);
    changes.rightCols<1>() = linear.Change(column.mean) / thresholds::kTermProbe;
  }
  return changes;
}

}  // namespace

PredictedGroup TestAlongTerms(const Context& context, const Hypothesis& hypothesis) {
  PredictedGroup least;
  if (!hypothesis.realised.empty() || !hypothesis.phases_rad.empty()) return least;
  const FitResult& fit = hypothesis.fit;
  const LinearFit linear(fit);
  const Eigen::MatrixXd error = ErrorOfChange(context, fit);
  int tests = 0;
  for (const Stage stage : kStages) {
    const std::vector<TermColumn> columns = TermColumnsOf(context, fit.parameters, stage);
    for (const Effect* term : TermsOf(columns)) {
      const ScoreTest test = TestDirections(linear, ChangesBy(*term, columns, linear), error);
      if (test.degrees_of_freedom == 0) continue;
      ++tests;
      if (test.p_value > least.p_value) continue;
      least.name = absl::StrCat("along ", std::string(term->description().id));
      least.chi_squared = test.chi_squared;
      least.degrees_of_freedom = test.degrees_of_freedom;
      least.p_value = test.p_value;
    }
  }
  least.p_value = std::min(1.0, least.p_value * tests);
  return least;
}

PredictiveCheck CheckNamed(const Context& context, const Hypothesis& hypothesis) {
  PredictiveCheck check = CheckHypothesis(context, hypothesis);
  if (hypothesis.effects.empty() || IsFreeForm(hypothesis) || check.p_value < kRejectedBelow) {
    return check;
  }
  const PredictedGroup directed = TestAlongTerms(context, hypothesis);
  if (directed.degrees_of_freedom > 0) AddTest(directed, &check);
  return check;
}

}  // namespace sightline
