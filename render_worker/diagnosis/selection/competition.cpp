// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/competition.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/random_effect/recording_scatter.h"
#include "render_worker/diagnosis/selection/candidate.h"
#include "render_worker/diagnosis/selection/competing.h"
#include "render_worker/diagnosis/selection/screening.h"

namespace sightline {
namespace {

constexpr size_t kFitted = 12;       // candidates fitted with the null model's derivatives
constexpr size_t kFittedAgain = 5;   // with their own
constexpr size_t kFittedAfresh = 4;  // from the nominal description on, if the null model fails
constexpr double kLeastGainForFit = 1.5;  // [nats] worth a fit
// The null model's deviations may hide an effect that it does not fail for.
constexpr size_t kFittedAfreshAnyway = 2;

}  // namespace

Competing::Competing(const SetModel& model, const FitResult& null,
                     const CompetitionSettings& settings,
                     const std::function<bool(double)>& progress)
    : model_(model),
      settings_(settings),
      progress_(progress),
      counts_{.effects = static_cast<int>(settings.effects.size()),
              .free_forms = static_cast<int>(settings.free_forms.size())},
      screening_(model, null),
      about_(null) {
  competition_.null = null;
  const auto sort = [&](std::span<const Effect* const> effects) {
    for (const Effect* effect : effects) {
      (IsRecordingScatter(*effect) ? scattering_ : expected_).push_back(effect);
    }
  };
  sort(settings.effects);
  sort(settings.free_forms);
}

Competition Competing::Run() {
  Screen();
  FitSingles();
  if (stopped_) return Unfinished();
  if (!FollowsVibration()) {
    FitPairs();
    RenewBest();
    AddRecordingScatter();
  }
  if (stopped_) return Unfinished();
  // If scatter explains most, the covariance of the null model is the one it has been compared
  // under; that of another effect may have room for it by chance.
  if (!ScatterLeads()) {
    std::erase_if(candidates_, IsScatter);
    FitUnderOneCovariance();
    AddRecordingScatter();
  }
  AddScatterToBest();
  AddTermsToBest();
  SelectTerms();
  if (stopped_) return Unfinished();
  Rank();
  JudgeByPredictions();
  FindClass();
  return std::move(competition_);
}

void Competing::Rank() {
  std::erase_if(candidates_, [](const auto& candidate) { return !EffectsAreThere(candidate); });
  Candidate none;
  none.fit = competition_.null;
  candidates_.push_back(std::move(none));
  RankCandidates(counts_, &candidates_);
  competition_.ranked = std::move(candidates_);
}

Competition Competing::Unfinished() {
  SortByEvidence();
  Rank();
  competition_.finished = false;
  return std::move(competition_);
}

void Competing::Screen() {
  const auto count = static_cast<double>(expected_.size());
  for (size_t i = 0; i < expected_.size(); ++i) {
    if (!Report(0.5 * static_cast<double>(i) / count)) return;
    competition_.screened.push_back(screening_.Screen(*expected_[i]));
  }
}

void Competing::Fit(Candidate& candidate, const FitResult& reference, bool renew,
                    int iterations) const {
  SetParameters start =
      candidate.fit.mean.empty() ? reference.parameters : candidate.fit.parameters;
  start.effects = candidate.effects;
  FitSettings settings;
  settings.rounds.clear();
  settings.renew_jacobian = renew;
  settings.max_iterations = iterations;
  candidate.fit = FitSet(model_, start, candidate.free, settings, &reference);
  candidate.effects = candidate.fit.parameters.effects;
  candidate.log_evidence = LogEvidence(candidate, competition_.null, about_);
}

void Competing::FitAfresh(Candidate& candidate) const {
  SetParameters start;
  start.effects = candidate.effects;
  start.line_shift_px = model_.EstimateLineShifts(start);
  FitSettings settings;
  settings.rounds = {{0.3, 0.3}, {0.1, 0.2}, {0.01, 0.1}, {0, 0.03}, {0, 0}};
  settings.middle_only = true;
  candidate.fit = FitSet(model_, start, candidate.free, settings, nullptr);
  candidate.effects = candidate.fit.parameters.effects;
  candidate.log_evidence = LogEvidence(candidate, competition_.null);
}

void Competing::SortByEvidence() {
  // A start that leaves no light at all has no number to compare.
  std::erase_if(candidates_, [](const auto& c) { return !std::isfinite(c.log_evidence); });
  std::stable_sort(
      candidates_.begin(), candidates_.end(),
      [](const Candidate& a, const Candidate& b) { return a.log_evidence > b.log_evidence; });
}

void Competing::FitSingles() {
  const auto promise = [](const ScreenedEffect& screened) {
    return std::max(screened.gain, screened.linear_gain);
  };
  std::vector<const ScreenedEffect*> order;
  for (const ScreenedEffect& screened : competition_.screened) {
    if (promise(screened) > kLeastGainForFit) order.push_back(&screened);
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](const auto* a, const auto* b) { return promise(*a) > promise(*b); });
  if (order.size() > kFitted) order.resize(kFitted);
  const bool rejected = NullIsRejected();
  size_t afresh = 0;
  for (size_t i = 0; i < order.size(); ++i) {
    if (!Report(0.5 + 0.25 * static_cast<double>(i) / kFitted)) return;
    const bool displaced =
        order[i]->linear_gain > 10 && order[i]->gain < 0.5 * order[i]->linear_gain;
    const bool promising = i < kFittedAfreshAnyway && promise(*order[i]) > kPromising;
    if ((rejected || displaced || promising) && afresh < kFittedAfresh) {
      ++afresh;
      const ActiveEffect& start = displaced ? order[i]->linear_best : order[i]->strongest;
      candidates_.push_back(MakeCandidate({start}));
      FitAfresh(candidates_.back());
      // With little weight on the data it may have lost its way.
      if (candidates_.back().log_evidence < 0.8 * promise(*order[i])) {
        Candidate near = MakeCandidate({start});
        Fit(near, competition_.null, false, 4);
        if (near.log_evidence > candidates_.back().log_evidence) {
          candidates_.back() = std::move(near);
        }
      }
    } else {
      candidates_.push_back(MakeCandidate({order[i]->strongest}));
      Fit(candidates_.back(), competition_.null, false, 4);
    }
  }
  SortByEvidence();
}

void Competing::RenewBest() {
  if (candidates_.empty() || stopped_ || !NullIsRejected()) return;
  if (!Report(0.84)) return;
  best_renewed_ = FitOfBest();
}

FitResult Competing::FitOfBest() const {
  const Candidate& best = candidates_.front();
  FitSettings settings;
  settings.rounds = {{0, 0.1}, {0, 0.02}, {0, 0}, {0, 0}};
  settings.max_iterations = 3;
  SetParameters start = best.fit.parameters;
  start.effects = best.effects;
  return FitSet(model_, start, best.free, settings, nullptr);
}

void Competing::FitUnderOneCovariance() {
  if (candidates_.empty() || stopped_) return;
  if (!Report(0.85)) return;
  const FitResult reference = best_renewed_ ? *std::move(best_renewed_) : FitOfBest();
  best_renewed_.reset();
  FitSettings settings;
  settings.rounds.clear();
  settings.max_iterations = 8;
  SetParameters null_start = competition_.null.parameters;
  null_start.effects.clear();
  FitResult null = FitSet(model_, null_start, {}, settings, &reference);
  competition_.null = std::move(null);
  about_ = reference;
  if (candidates_.size() > kFitted) candidates_.resize(kFitted);
  for (size_t i = 0; i < candidates_.size(); ++i) {
    if (!Report(0.87 + 0.12 * static_cast<double>(i) / static_cast<double>(candidates_.size())))
      return;
    if (i == 0) {
      candidates_[i].fit.parameters = reference.parameters;
      candidates_[i].effects = reference.parameters.effects;
    }
    Fit(candidates_[i], reference, i < kFittedAgain, i < kFittedAgain ? 6 : 3);
  }
  SortByEvidence();
  FitPartsOfBest(reference);
}

void Competing::FitPartsOfBest(const FitResult& reference) {
  const Candidate best = candidates_.front();
  if (best.effects.size() < 2) return;
  for (const ActiveEffect& part : best.effects) {
    Candidate alone = MakeCandidate({part});
    alone.fit.parameters = best.fit.parameters;
    alone.fit.mean = best.fit.mean;
    Fit(alone, reference, true, 8);
    const auto known = std::find_if(candidates_.begin(), candidates_.end(), [&](const auto& c) {
      return c.effects.size() == 1 && c.effects[0].effect == part.effect;
    });
    if (known == candidates_.end()) {
      candidates_.push_back(std::move(alone));
    } else if (alone.log_evidence > known->log_evidence) {
      *known = std::move(alone);
    }
  }
  SortByEvidence();
}

Competition Compete(const SetModel& model, const FitResult& null,
                    const CompetitionSettings& settings,
                    const std::function<bool(double)>& progress) {
  return Competing(model, null, settings, progress).Run();
}

}  // namespace sightline
