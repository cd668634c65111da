// SPDX-License-Identifier: Apache-2.0
// What scatters between recordings, by itself and besides effects.
#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/random_effect/realisation.h"
#include "render_worker/diagnosis/random_effect/recording_scatter.h"
#include "render_worker/diagnosis/random_effect/vibration_phases.h"
#include "render_worker/diagnosis/selection/candidate.h"
#include "render_worker/diagnosis/selection/competing.h"
#include "render_worker/diagnosis/selection/screening.h"

namespace sightline {
namespace {

constexpr double kHopeless = 1000;         // above which it tells nothing of what it lacks
constexpr double kMostlyExplained = 0.05;  // of chi squared left by what brings it near
constexpr size_t kScatterBases = 2;        // effects besides which scatter is looked for

}  // namespace

bool Competing::FollowsVibration() {
  const FitResult& null = competition_.null;
  if (null.chi_squared < kHopeless * null.data_count) return false;
  if (std::any_of(candidates_.begin(), candidates_.end(), [&](const Candidate& candidate) {
        return candidate.fit.chi_squared < kMostlyExplained * null.chi_squared;
      })) {
    return false;
  }
  const std::vector<double> displacements = DisplacementsAtPositions(model_, null.parameters);
  if (std::all_of(displacements.begin(), displacements.end(), [](double d) { return d == 0; })) {
    return false;
  }
  std::vector<Candidate> others = std::exchange(candidates_, {});
  AddRecordingScatter();
  const bool follows = !candidates_.empty() && !candidates_.front().phases_rad.empty();
  if (!follows) {
    candidates_ = std::move(others);
    return false;
  }
  // Under the null model's covariance others tell nothing.
  const Candidate& vibration = candidates_.front();
  const double others_offset = vibration.log_evidence - LogEvidence(vibration, competition_.null);
  for (Candidate& other : others) {
    if (other.fit.whitening == null.whitening) continue;
    other.log_evidence = LogEvidence(other, competition_.null) + others_offset;
    candidates_.push_back(std::move(other));
  }
  SortByEvidence();
  return true;
}

bool Competing::ScatterLeads() const {
  if (candidates_.empty() || !IsScatter(candidates_.front())) return false;
  return !best_renewed_ || TwiceCost(candidates_.front().fit) < TwiceCost(*best_renewed_);
}

void Competing::AddRecordingScatter() {
  if (stopped_) return;
  // An effect that makes recordings of one place agree leaves no strong scatter.
  const bool perhaps_strong =
      candidates_.empty() || IsScatter(candidates_.front()) ||
      ScattersStrongly(model_, best_renewed_ ? *best_renewed_ : candidates_.front().fit);
  for (ScatterCandidate& scatter :
       CompareRecordingScatter(model_, competition_.null, scattering_, perhaps_strong)) {
    Candidate candidate;
    candidate.effects = {{scatter.effect, scatter.parameters}};
    candidate.free = scatter.fit.free;
    candidate.log_evidence = scatter.log_evidence;
    candidate.fit = std::move(scatter.fit);
    candidate.drawn = Drawn(scatter);
    candidate.phases_rad = std::move(scatter.phases_rad);
    // Where the null model is far off, its linearisation is too; at what has been drawn the model
    // itself counts.
    const FitResult& null = competition_.null;
    if (null.chi_squared > kRejected * null.data_count) {
      candidate.log_evidence = std::max(candidate.log_evidence, LogEvidence(candidate, null));
    }
    candidates_.push_back(std::move(candidate));
  }
  SortByEvidence();
}

std::vector<ScreenedEffect> Competing::ScreenBesidesScatter(const Candidate& scatter) {
  // What has been drawn is in the residual, not in what is expected of other parameters.
  FitResult about = scatter.fit;
  about.mean = model_.Expect(about.parameters, false).mean;
  return ScreenNamed(Screening(model_, about), 0.96);
}

std::vector<ScreenedEffect> Competing::ScreenNamed(const Screening& screening, double fraction) {
  std::vector<ScreenedEffect> found;
  for (const Effect* effect : expected_) {
    if (IsFreeForm(*effect)) continue;
    if (!Report(fraction)) break;
    found.push_back(screening.Screen(*effect));
  }
  return found;
}

std::vector<Candidate> Competing::BasesOfScatter() {
  std::vector<Candidate> bases;
  const Candidate& best = candidates_.front();
  if (IsScatter(best)) {
    std::vector<Joint> joints;
    AddJoints(best, NullIsRejected() ? ScreenBesidesScatter(best) : std::vector<ScreenedEffect>(),
              joints);
    SortByTotal(joints);
    for (const Joint& joint : joints) {
      if (bases.size() == kScatterBases) break;
      if (joint.gain < kPairGain) continue;
      bases.push_back(MakeCandidate({joint.added}));
      Fit(bases.back(), competition_.null, false, 4);
      if (!std::isfinite(bases.back().log_evidence)) bases.pop_back();
    }
    return bases;
  }
  for (const Candidate& candidate : candidates_) {
    if (bases.size() == kScatterBases || candidate.log_evidence < kPairGain) break;
    const bool single = candidate.effects.size() == 1;
    if (single && !IsFreeForm(candidate) && !IsScatter(candidate)) bases.push_back(candidate);
  }
  return bases;
}

void Competing::AddScatterToBest() {
  if (stopped_ || settings_.max_effects < 2 || candidates_.empty()) return;
  if (!candidates_.front().phases_rad.empty()) {
    AddToVibration();
    return;
  }
  // What explains most is part of every pair.
  std::span<const Effect* const> effects = settings_.effects;
  const Effect* const only =
      IsScatter(candidates_.front()) ? candidates_.front().effects[0].effect : nullptr;
  if (only != nullptr) effects = {&only, 1};
  const std::vector<Candidate> bases = BasesOfScatter();
  // Where recordings of one place agree about the best base, others scatter for want of it.
  const bool perhaps_strong = !bases.empty() && ScattersStrongly(model_, bases.front().fit);
  for (const Candidate& base : bases) {
    for (ScatterCandidate& scatter :
         CompareRecordingScatter(model_, base.fit, effects, perhaps_strong)) {
      if (scatter.log_evidence < kPairGain) continue;
      Candidate pair;
      pair.effects = scatter.fit.parameters.effects;
      pair.free = scatter.fit.free;
      pair.log_evidence = base.log_evidence + scatter.log_evidence;
      pair.drawn = Drawn(scatter);
      pair.fit = std::move(scatter.fit);
      candidates_.push_back(std::move(pair));
    }
  }
  SortByEvidence();
}

void Competing::AddToVibration() {
  const Candidate best = candidates_.front();
  const ActiveEffect vibration = best.effects.back();
  const std::unique_ptr<const Effect> phased =
      VibrationAtPhases(*vibration.effect, best.phases_rad);
  std::vector<bool> used;
  Candidate base = best;
  for (int e = 0; e < model_.entries(); ++e) {
    used.push_back(!model_.ComparesSpeckle(e) && model_.StatisticOf(e).name() != "texture");
    if (used.back()) continue;
    base.fit.residual[e].setZero();
    base.fit.jacobian[e].setZero();
  }
  base.fit.parameters.effects.back().effect = phased.get();
  const std::vector<ScreenedEffect> found = ScreenNamed(Screening(model_, base.fit, used), 0.97);
  if (stopped_) return;
  std::vector<Joint> joints;
  AddJoints(base, found, joints);
  SortByTotal(joints);
  // What the evidence takes from the data, of the entries used.
  struct DataPart {
    double chi_squared = 0, log_determinant = 0;
  };
  const auto of_used = [&](const FitResult& fit) {
    DataPart part;
    for (size_t e = 0; e < used.size(); ++e) {
      if (!used[e]) continue;
      part.chi_squared += fit.residual[e].squaredNorm();
      part.log_determinant += fit.whitening->LogDeterminant(static_cast<int>(e));
    }
    return part;
  };
  const auto exchange_data = [](FitResult& fit, const DataPart& part) {
    return DataPart{std::exchange(fit.chi_squared, part.chi_squared),
                    std::exchange(fit.data_log_determinant, part.log_determinant)};
  };
  exchange_data(base.fit, of_used(base.fit));
  const auto follow = [&](const std::vector<ActiveEffect>& besides, const Candidate& from) {
    SetParameters start = from.fit.parameters;
    start.effects = besides;
    FollowedVibration followed =
        FollowVibration(model_, start, FreeParameters(besides), *vibration.effect,
                        from.effects.back().parameters, from.phases_rad);
    Candidate candidate;
    candidate.effects = followed.fit.parameters.effects;
    candidate.free = followed.fit.free;
    candidate.fit = std::move(followed.fit);
    candidate.phases_rad = std::move(followed.phases_rad);
    const DataPart whole = exchange_data(candidate.fit, of_used(candidate.fit));
    candidate.log_evidence =
        best.log_evidence + LogEvidence(candidate, base.fit) - LogEvidence(base, base.fit);
    exchange_data(candidate.fit, whole);
    return candidate;
  };
  std::vector<Candidate> pairs;
  for (const Joint& joint : joints) {
    if (pairs.size() == kScatterBases || joint.gain < kPairGain) break;
    if (!Report(0.98)) return;
    Candidate pair = follow({joint.added}, best);
    if (!std::isfinite(pair.log_evidence)) break;
    pairs.push_back(std::move(pair));
  }
  if (pairs.empty()) return;
  // The vibration by itself from where the best pair led: its phases may not have been the best.
  const Candidate& leading = *std::max_element(
      pairs.begin(), pairs.end(),
      [](const auto& a, const auto& b) { return a.log_evidence < b.log_evidence; });
  if (leading.log_evidence > best.log_evidence) {
    Candidate alone = follow({}, leading);
    if (alone.log_evidence > best.log_evidence) candidates_.front() = std::move(alone);
  }
  for (Candidate& pair : pairs) candidates_.push_back(std::move(pair));
  SortByEvidence();
}

std::vector<double> Competing::Drawn(const ScatterCandidate& scatter) {
  const bool light = std::any_of(scatter.light_relative.begin(), scatter.light_relative.end(),
                                 [](double drawn) { return drawn != 0; });
  return light ? scatter.light_relative : scatter.shift_px;
}

}  // namespace sightline
