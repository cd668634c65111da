// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/random_effect/realisation.h"
#include "render_worker/diagnosis/random_effect/vibration_phases.h"
#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/thresholds.h"

namespace sightline {
namespace {

// Terms of the evidence that depend on the data, of some observation blocks.
struct DataTerms {
  double chi_squared = 0, log_determinant = 0;
};

DataTerms TermsOf(const FitResult& fit, const std::vector<bool>& used) {
  DataTerms terms;
  for (size_t e = 0; e < used.size(); ++e) {
    if (!used[e]) continue;
    terms.chi_squared += fit.residual[e].squaredNorm();
    terms.log_determinant += fit.whitening->LogDeterminant(static_cast<int>(e));
  }
  return terms;
}

// Returns the terms that `fit` had.
DataTerms ExchangeTerms(FitResult& fit, const DataTerms& terms) {
  return {std::exchange(fit.chi_squared, terms.chi_squared),
          std::exchange(fit.data_log_determinant, terms.log_determinant)};
}

// Observation blocks that are not about speckle.
std::vector<bool> BlocksWithoutSpeckle(const SetModel& model) {
  std::vector<bool> used;
  for (int e = 0; e < model.blocks(); ++e) {
    used.push_back(!model.StatisticOf(e).compares_speckle() &&
                   model.StatisticOf(e).kind() != StatisticKind::kTexture);
  }
  return used;
}

// A vibration whose phases were fitted, as the hypothesis that effects are added to.
struct FollowedBase {
  Hypothesis best;  // with the random vibration as its last effect
  // The same with the vibration at its phases as an effect that changes the expectation, restricted
  // to the blocks `used`.
  std::unique_ptr<const Effect> phased;
  Hypothesis restricted;
  std::vector<bool> used;
};

FollowedBase MakeFollowedBase(const SetModel& model, const Hypothesis& best) {
  FollowedBase base{best, VibrationAtPhases(*best.effects.back().effect, best.phases_rad), best,
                    BlocksWithoutSpeckle(model)};
  for (size_t e = 0; e < base.used.size(); ++e) {
    if (base.used[e]) continue;
    base.restricted.fit.residual[e].setZero();
    base.restricted.fit.jacobian[e].setZero();
  }
  base.restricted.fit.parameters.effects.back().effect = base.phased.get();
  return base;
}

// The vibration and `beside`, fitted from the phases of `from`. The evidence is that of `base` plus
// the gain in the blocks used; `base.restricted.fit` has the data terms of these.
Hypothesis FitWithVibration(const SetModel& model, const FollowedBase& base,
                            const std::vector<ActiveEffect>& beside, const Hypothesis& from) {
  SetParameters start = from.fit.parameters;
  start.effects = beside;
  FollowedVibration followed =
      FollowVibration(model, start, FreeParameters(beside), *base.best.effects.back().effect,
                      from.effects.back().parameters, from.phases_rad);
  Hypothesis hypothesis;
  hypothesis.effects = followed.fit.parameters.effects;
  hypothesis.free = followed.fit.free;
  hypothesis.fit = std::move(followed.fit);
  hypothesis.phases_rad = std::move(followed.phases_rad);
  const DataTerms whole = ExchangeTerms(hypothesis.fit, TermsOf(hypothesis.fit, base.used));
  SetEvidence(base.best.evidence + EvidenceOver(hypothesis, base.restricted.fit) -
                  EvidenceOver(base.restricted, base.restricted.fit),
              &hypothesis);
  ExchangeTerms(hypothesis.fit, whole);
  return hypothesis;
}

}  // namespace

std::vector<Hypothesis> FollowStrongVibration(const Context& context,
                                              std::vector<Hypothesis> hypotheses) {
  const FitResult& null = context.null;
  if (null.chi_squared < thresholds::kHopeless * null.data_count) return hypotheses;
  if (std::any_of(hypotheses.begin(), hypotheses.end(), [&](const Hypothesis& hypothesis) {
        return hypothesis.fit.chi_squared < thresholds::kMostlyExplained * null.chi_squared;
      })) {
    return hypotheses;
  }
  const std::vector<double> displacements =
      DisplacementsAtPositions(context.model, null.parameters);
  if (std::all_of(displacements.begin(), displacements.end(), [](double d) { return d == 0; })) {
    return hypotheses;
  }
  std::vector<Hypothesis> found = AddRandomEffects(context, {}, nullptr);
  if (found.empty() || found.front().phases_rad.empty()) return hypotheses;
  // Evidence under the null model's covariance is meaningless here. Others, with covariances of
  // their own, compare with the vibration's fit; the offset is what its evidence was raised by.
  const Hypothesis& vibration = found.front();
  const Evidence offset = vibration.evidence - EvidenceOver(vibration, null);
  for (Hypothesis& other : hypotheses) {
    if (other.fit.whitening == null.whitening) continue;
    SetEvidence(EvidenceOver(other, null) + offset, &other);
    found.push_back(std::move(other));
  }
  return SortedByEvidence(std::move(found));
}

bool VibrationIsFollowed(const std::vector<Hypothesis>& hypotheses) {
  return std::any_of(hypotheses.begin(), hypotheses.end(),
                     [](const Hypothesis& hypothesis) { return !hypothesis.phases_rad.empty(); });
}

StageResult AddEffectsBesideVibration(const Context& context, std::vector<Hypothesis> hypotheses) {
  FollowedBase base = MakeFollowedBase(context.model, hypotheses.front());
  const ScreeningResult screened =
      ScreenNamed(context, Screening(context.model, base.restricted.fit, base.used), 0.97);
  if (screened.stopped) return {std::move(hypotheses), true};
  const std::vector<JointEffect> joints =
      SortedByTotal(JointGains(context, base.restricted, screened.effects));
  ExchangeTerms(base.restricted.fit, TermsOf(base.restricted.fit, base.used));
  std::vector<Hypothesis> pairs;
  for (const JointEffect& joint : joints) {
    if (pairs.size() == thresholds::kRandomEffectBases || joint.gain < thresholds::kPairGain_nats) {
      break;
    }
    if (!context.proceed(0.98)) return {std::move(hypotheses), true};
    Hypothesis pair = FitWithVibration(context.model, base, {joint.added}, base.best);
    if (!std::isfinite(pair.log_evidence)) break;
    pairs.push_back(std::move(pair));
  }
  if (pairs.empty()) return {std::move(hypotheses)};
  // The vibration by itself from where the best pair led: its phases may not have been the best.
  const Hypothesis& leading = *std::max_element(
      pairs.begin(), pairs.end(),
      [](const auto& a, const auto& b) { return a.log_evidence < b.log_evidence; });
  if (leading.log_evidence > base.best.log_evidence) {
    Hypothesis alone = FitWithVibration(context.model, base, {}, leading);
    if (alone.log_evidence > base.best.log_evidence) hypotheses.front() = std::move(alone);
  }
  for (Hypothesis& pair : pairs) hypotheses.push_back(std::move(pair));
  return {SortedByEvidence(std::move(hypotheses))};
}

}  // namespace sightline
