// SPDX-License-Identifier: Apache-2.0
// Free-form terms besides the best effect, and with as few coefficients as they need.
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/fit/linear_fit.h"
#include "render_worker/diagnosis/random_effect/recording_scatter.h"
#include "render_worker/diagnosis/selection/candidate.h"
#include "render_worker/diagnosis/selection/competing.h"
#include "render_worker/diagnosis/selection/term_selection.h"

namespace sightline {
namespace {

// Terms that are to be fitted with fewer coefficients: as many, and not farther behind the best.
constexpr int kSelected = 4;
constexpr double kSelectedBehind = 15;  // [nats]

}  // namespace

void Competing::AddTermsToBest() {
  if (stopped_ || candidates_.empty()) return;
  const auto leading = std::find_if(candidates_.begin(), candidates_.end(), [](const auto& c) {
    return c.effects.size() == 1 && !IsFreeForm(c) && !IsScatter(c);
  });
  if (leading == candidates_.end() || leading->log_evidence < kPromising) return;
  const bool rejected = Check(candidates_.front()).p_value < kRejectedBelow;
  if (!rejected && leading != candidates_.begin()) return;
  const Candidate best = *leading;
  const LinearFit linear(best.fit);
  for (const Effect* term : settings_.free_forms) {
    // What the whole vocabulary does not describe may be at any other stage as well.
    const bool near = term->description().stage == best.effects[0].effect->description().stage;
    if (IsRecordingScatter(*term) || (!near && !rejected)) continue;
    if (!Report(0.99)) break;
    const auto& parameters = term->description().parameters;
    const auto n = static_cast<Eigen::Index>(parameters.size());
    Candidate candidate = best;
    candidate.effects.push_back(AtNullValues(*term));
    std::vector<Eigen::VectorXd> slopes;
    Eigen::MatrixXd information = Eigen::MatrixXd::Identity(n, n);
    Eigen::VectorXd gradient(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      constexpr double kProbe = 0.5;
      SetParameters moved = best.fit.parameters;
      moved.effects = candidate.effects;
      moved.effects[1].parameters[i] = ParameterFromStandardised(parameters[i], kProbe);
      slopes.push_back(linear.Change(model_.Expect(moved, false).mean) / kProbe);
      gradient[i] = linear.residual().dot(slopes[i]);
      for (Eigen::Index j = 0; j <= i; ++j) {
        const double inner = linear.Inner(slopes[i], slopes[j]);
        information(i, j) += inner;
        if (i != j) information(j, i) += inner;
      }
    }
    const Eigen::VectorXd z = information.llt().solve(gradient);
    if (0.5 * z.dot(gradient) < kPairGain) continue;
    for (Eigen::Index i = 0; i < n; ++i) {
      candidate.effects[1].parameters[i] = ParameterFromStandardised(parameters[i], z[i]);
    }
    candidate.free = FreeParameters(candidate.effects);
    Fit(candidate, best.fit, false, 6);
    candidates_.push_back(std::move(candidate));
  }
  SortByEvidence();
}

void Competing::SelectTerms() {
  if (stopped_ || candidates_.empty()) return;
  const double best = candidates_.front().log_evidence;
  int selected = 0;
  for (Candidate& candidate : candidates_) {
    if (!IsFreeForm(candidate) || IsScatter(candidate)) continue;
    std::optional<Candidate> simpler = WithFewerCoefficients(candidate, best - kSelectedBehind);
    if (!simpler) continue;
    if (simpler->log_evidence > candidate.log_evidence) candidate = *std::move(simpler);
    if (++selected == kSelected) break;
  }
  SortByEvidence();
}

std::optional<Candidate> Competing::WithFewerCoefficients(const Candidate& candidate,
                                                          double least) const {
  const auto first =
      candidate.fit.standardised.size() - static_cast<Eigen::Index>(candidate.free.size());
  std::vector<int> coefficients;
  std::vector<size_t> places;  // in `free`
  std::vector<EffectParameter> parameters;
  for (size_t f = 0; f < candidate.free.size(); ++f) {
    const ActiveEffect& active = candidate.effects[candidate.free[f].effect];
    if (!IsFreeForm(*active.effect)) continue;
    coefficients.push_back(static_cast<int>(first) + static_cast<int>(f));
    places.push_back(f);
    parameters.push_back(active.effect->description().parameters[candidate.free[f].parameter]);
  }
  const TermSelection selection =
      SelectCoefficients(candidate.fit.standardised, candidate.fit.covariance,
                         candidate.fit.prior_weight, coefficients, parameters);
  if (selection.log_evidence_gain <= 0 ||
      candidate.log_evidence + selection.log_evidence_gain < least) {
    return std::nullopt;
  }
  Candidate simpler = candidate;
  for (size_t f = 0; f < candidate.free.size(); ++f) {
    const auto [effect, parameter] = candidate.free[f];
    const EffectParameter& described =
        candidate.effects[effect].effect->description().parameters[parameter];
    simpler.effects[effect].parameters[parameter] = ParameterFromStandardised(
        described, selection.standardised[first + static_cast<Eigen::Index>(f)]);
  }
  for (size_t k = places.size(); k-- > 0;) {
    if (!selection.needed[k]) {
      simpler.free.erase(simpler.free.begin() + static_cast<std::ptrdiff_t>(places[k]));
    }
  }
  simpler.fit.parameters = AtStandardised(model_, candidate.fit.parameters, selection.standardised);
  Fit(simpler, candidate.fit, false, 4);
  return simpler;
}

}  // namespace sightline
