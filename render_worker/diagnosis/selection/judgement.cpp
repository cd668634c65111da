// SPDX-License-Identifier: Apache-2.0
// Names are given to what predicts recordings that were not fitted.
#include <Eigen/Core>
#include <algorithm>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/fit/linear_fit.h"
#include "render_worker/diagnosis/random_effect/setup_independence.h"
#include "render_worker/diagnosis/selection/candidate.h"
#include "render_worker/diagnosis/selection/competing.h"
#include "render_worker/diagnosis/selection/screening.h"

namespace sightline {
namespace {

// What effects must gain in recordings not fitted [nats] to be named: odds of 20.
constexpr double kClearGain = 3;

}  // namespace

PredictiveCheck Competing::Check(const Candidate& candidate) const {
  PredictiveCheck check =
      CheckPredictions(model_, candidate.fit, competition_.null, settings_.seed);
  if (candidate.drawn.empty()) return check;
  // What was drawn is predicted with all the width of its law; that it does not follow the set-up
  // is what the law says more.
  PredictedGroup independence;
  independence.name = "independence of the set-up";
  independence.p_value = SetupIndependencePValue(model_.set(), candidate.drawn, settings_.seed);
  AddTest(independence, &check);
  return check;
}

double Competing::ScoreWithout(const Candidate& candidate,
                               const std::vector<double>& scores) const {
  double best = competition_.null_check.log_score;
  for (size_t c = 0; c < competition_.ranked.size(); ++c) {
    const Candidate& part = competition_.ranked[c];
    if (part.effects.empty() || part.effects.size() >= candidate.effects.size()) continue;
    const bool among = std::all_of(part.effects.begin(), part.effects.end(),
                                   [&](const auto& a) { return Has(candidate, a.effect); });
    if (among) best = std::max(best, scores[c]);
  }
  return best;
}

void Competing::JudgeByPredictions() {
  std::vector<Candidate>& ranked = competition_.ranked;
  Candidate none;
  none.fit = competition_.null;
  competition_.null_check = Check(none);
  competition_.named_check = competition_.null_check;
  EraseWhatDoesNotPredict();
  const auto leading = std::find_if(ranked.begin(), ranked.end(),
                                    [](const auto& candidate) { return !IsFreeForm(candidate); });
  if (leading->effects.empty()) {
    competition_.named = std::move(none);
  } else {
    competition_.named = *leading;
    competition_.named_check = Check(*leading);
  }
  // Odds of unknown physics over what the vocabulary says.
  const double odds =
      kUnknownPrior / (1 - kUnknownPrior) * BayesFactorBound(competition_.named_check.p_value);
  double unknown = 0;
  for (const Candidate& candidate : ranked) {
    if (IsFreeForm(candidate)) unknown += candidate.probability;
  }
  const double share = odds / (1 + odds);
  if (competition_.named_check.p_value < kRejectedBelow && unknown < share) {
    ShareWithUnknown(share);
  }
}

void Competing::EraseWhatDoesNotPredict() {
  std::vector<Candidate>& ranked = competition_.ranked;
  std::vector<double> scores(ranked.size(), -1e300);
  for (size_t c = 0; c < ranked.size(); ++c) {
    if (!IsFreeForm(ranked[c])) scores[c] = Check(ranked[c]).log_score;
  }
  std::vector<Candidate> predicting;
  for (size_t c = 0; c < ranked.size(); ++c) {
    const bool named = !ranked[c].effects.empty() && !IsFreeForm(ranked[c]);
    if (named && !(scores[c] - ScoreWithout(ranked[c], scores) > kClearGain)) continue;
    predicting.push_back(ranked[c]);
  }
  ranked = std::move(predicting);
  RankCandidates(counts_, &ranked);
}

void Competing::ShareWithUnknown(double share) {
  std::vector<Candidate> known, unknown;
  for (Candidate& candidate : competition_.ranked) {
    (IsFreeForm(candidate) ? unknown : known).push_back(std::move(candidate));
  }
  if (unknown.empty()) {
    const ScreenedEffect* best = nullptr;
    for (const ScreenedEffect& screened : competition_.screened) {
      if (!IsFreeForm(*screened.strongest.effect)) continue;
      if (best == nullptr || screened.gain > best->gain) best = &screened;
    }
    if (best != nullptr) {
      unknown.push_back(MakeCandidate({AtNullValues(*best->strongest.effect)}));
      unknown.back().free.clear();
      unknown.back().fit = competition_.null;
      unknown.back().fit.parameters.effects = unknown.back().effects;
    }
  }
  std::vector<Candidate>& ranked = competition_.ranked;
  ranked.clear();
  if (unknown.empty()) share = 0;
  const auto add = [&](std::vector<Candidate>& candidates, double probability) {
    if (candidates.empty()) return;
    RankCandidates(counts_, &candidates);
    for (Candidate& candidate : candidates) {
      candidate.probability *= probability;
      ranked.push_back(std::move(candidate));
    }
  };
  add(known, 1 - share);
  add(unknown, share);
  std::stable_sort(ranked.begin(), ranked.end(), [](const Candidate& a, const Candidate& b) {
    return a.probability > b.probability;
  });
}

void Competing::FindClass() {
  const Candidate& best = competition_.ranked.front();
  if (best.effects.empty() || IsFreeForm(best)) return;
  const LinearFit& linear = screening_.linear();
  const Eigen::VectorXd change = screening_.ChangeOf(best.effects.front());
  const double length = linear.Inner(change, change);
  for (const ScreenedEffect& other : competition_.screened) {
    const Effect* effect = other.strongest.effect;
    if (effect == best.effects.front().effect || other.change.size() == 0) continue;
    if (IsFreeForm(*effect)) continue;
    const double product = linear.Inner(change, other.change);
    const double other_length = linear.Inner(other.change, other.change);
    if (other_length > 1e-9 && product * product > 0.98 * length * other_length) {
      competition_.same_class.push_back(effect);
    }
  }
}

}  // namespace sightline
