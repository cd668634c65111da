// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/random_effect/compare_random_effects.h"

#include <algorithm>
#include <map>
#include <memory>
#include <utility>

#include "render_worker/diagnosis/random_effect/evaluate_random_effect.h"
#include "render_worker/diagnosis/random_effect/linearised_set.h"
#include "render_worker/diagnosis/random_effect/realisation.h"
#include "render_worker/diagnosis/random_effect/vibration_phases.h"

namespace sightline {
namespace {

// A texture that leaves less than this fraction of the null model's chi squared is the main effect,
// and so strong that light is not linear in its amplitudes.
constexpr double kStrongTextureLeaves = 0.5;

// Mean square of the whitened residuals of blocks that compare speckle above which recordings of
// one position differ strongly.
constexpr double kStrongMeanSquare = 10;

// Turns between the nuisance parameters and the random effect, without and with other effects.
constexpr int kTurnsAlone = 4, kTurnsBesideEffects = 2;

// Decrease of twice the cost below which the turns end.
constexpr double kConvergedTwiceCost = 1;

// A plate position may be off by this many standard uncertainties; what is more is movement.
constexpr double kLargestPositionError = 3;

struct EffectAndLaw {
  const Effect* effect;
  std::shared_ptr<const RandomEffect> law;
};

// Nuisance parameters of `null` at a realisation, fitted to the blocks that do not compare speckle
// and linearised with all blocks. `start`: without the realisation.
FitResult FitAtRealisation(const SetModel& model, const FitResult& null, SetParameters start,
                           const Realisation& realisation, std::vector<FitSettings::Round> rounds) {
  const RealisedEffect realised(realisation);
  start.effects.push_back({&realised, {}});
  FitSettings settings;
  settings.rounds = std::move(rounds);
  for (int e = 0; e < model.blocks(); ++e) {
    settings.use_block.push_back(!model.StatisticOf(e).compares_speckle());
  }
  const SetParameters found = FitSet(model, start, null.free, settings, nullptr).parameters;
  settings.use_block.clear();
  settings.rounds.assign(1, FitSettings::Round());
  settings.max_iterations = 0;
  FitResult fit = FitSet(model, found, null.free, settings, nullptr);
  fit.parameters.effects.pop_back();
  return fit;
}

// Line shifts beyond the uncertainty of a plate position become displacements of its recordings.
void MoveExcessShifts(const SetModel& model, SetParameters& parameters, Realisation& at) {
  const RecordedSet& set = model.set();
  const double allowed_px =
      kLargestPositionError * set.description.uncertainty.line_position_each_px;
  for (auto& [id, shift_px] : parameters.line_shift_px) {
    const double bounded_px = std::clamp(shift_px, -allowed_px, allowed_px);
    for (size_t f = 0; f < at.shift_px.size(); ++f) {
      if (set.frames[f].plate_position_id == id) at.shift_px[f] += shift_px - bounded_px;
    }
    shift_px = bounded_px;
  }
}

// All of `effects`, linearised about one fit, so that they differ by their distributions only.
struct ComparedAboutOneFit {
  std::vector<EvaluatedRandomEffect> evaluated;
  size_t leading = 0;
};

ComparedAboutOneFit CompareAbout(const LinearisationBasis& basis,
                                 const std::vector<EffectAndLaw>& effects, const Realisation& at) {
  ComparedAboutOneFit compared;
  compared.evaluated.reserve(effects.size());
  for (size_t i = 0; i < effects.size(); ++i) {
    compared.evaluated.push_back(
        EvaluateRandomEffect(basis, *effects[i].effect, *effects[i].law, at));
    const bool better = compared.evaluated[i].candidate.log_evidence >
                        compared.evaluated[compared.leading].candidate.log_evidence;
    // The first movement, a vibration if there is one, keeps the lead: it is followed from its own
    // realisation.
    if (i == 0 || (better && effects[0].law->amplitude() != Amplitude::kShift)) {
      compared.leading = i;
    }
  }
  return compared;
}

// Strong random effects make the null model's parameters wrong: fit these and the random effect in
// turn. `effects` have the same amplitudes with different distributions.
std::vector<RandomEffectCandidate> EvaluateStrong(const SetModel& model, const FitResult& null,
                                                  const std::vector<EffectAndLaw>& effects) {
  SetParameters start;
  start.effects = null.parameters.effects;
  const RandomEffect& first = *effects[0].law;
  Realisation at = first.StartFromRecordings(start);
  std::vector<FitSettings::Round> rounds = {{0.3, 0.3}, {0.1, 0.3}, {0.01, 0.1}, {0, 0}};
  std::vector<RandomEffectCandidate> best(effects.size());
  double cost = 0;
  const int most_turns = null.parameters.effects.empty() ? kTurnsAlone : kTurnsBesideEffects;
  for (int turn = 0; turn < most_turns; ++turn) {
    const FitResult about = FitAtRealisation(model, null, start, at, rounds);
    ComparedAboutOneFit compared = CompareAbout(MakeBasis(model, about, at, null), effects, at);
    const EvaluatedRandomEffect& leading = compared.evaluated[compared.leading];
    const double cost_of_turn = TwiceCost(leading.candidate.fit);
    const double gained = turn == 0 ? 0 : cost - cost_of_turn;
    if (turn == 0 || gained > 0) {
      cost = cost_of_turn;
      start = leading.candidate.fit.parameters;
      start.effects.pop_back();
      at = leading.realisation;
      for (size_t i = 0; i < effects.size(); ++i) {
        best[i] = std::move(compared.evaluated[i].candidate);
      }
    }
    if (turn > 0 && gained < kConvergedTwiceCost) break;
    rounds = {{0, 0.1}, {0, 0}};
    if (first.amplitude() == Amplitude::kShift) MoveExcessShifts(model, start, at);
  }
  return best;
}

// Fits the phases of the recordings in place of normal amplitudes and symmetric blur, and keeps
// them if they have more evidence.
void FollowPhases(const SetModel& model, const FitResult& null, RandomEffectCandidate& candidate) {
  SetParameters start = candidate.fit.parameters;
  start.effects.pop_back();
  FollowedVibration followed = FollowVibration(model, start, null.free, *candidate.effect,
                                               {candidate.parameters[0], candidate.parameters[1]},
                                               std::move(candidate.phases_rad));
  candidate.phases_rad.clear();
  FitResult& fit = followed.fit;
  const double gained = 0.5 * (TwiceCost(candidate.fit) - TwiceCost(fit));
  if (!(gained > 0)) return;
  candidate.parameters = fit.parameters.effects.back().parameters;
  const size_t before = fit.effect_standard_errors.size() - candidate.parameters.size();
  candidate.standard_errors.assign(fit.effect_standard_errors.begin() + before,
                                   fit.effect_standard_errors.end());
  candidate.log_evidence += gained;
  candidate.largest_gain += gained;
  candidate.fit = std::move(fit);
  candidate.phases_rad = std::move(followed.phases_rad);
}

}  // namespace

bool RecordingsDifferStrongly(const SetModel& model, const FitResult& fit) {
  double chi_squared = 0, count = 0;
  for (int e = 0; e < model.blocks(); ++e) {
    if (!model.StatisticOf(e).compares_speckle()) continue;
    chi_squared += fit.residual[e].squaredNorm();
    count += static_cast<double>(fit.residual[e].size());
  }
  return chi_squared > kStrongMeanSquare * count;
}

std::vector<RandomEffectCandidate> CompareRandomEffects(const SetModel& model,
                                                        const FitResult& null,
                                                        std::span<const Effect* const> effects,
                                                        bool perhaps_strong) {
  const bool strong = perhaps_strong && RecordingsDifferStrongly(model, null);
  const LinearisationBasis basis =
      MakeBasis(model, null, Realisation(model.set().frames.size()), null);
  std::vector<EffectAndLaw> strong_light, strong_movement, strong_reflectance;
  std::map<const Effect*, RandomEffectCandidate> found;
  for (const Effect* effect : effects) {
    if (!HasRandomLaw(*effect)) continue;
    const EffectAndLaw random{effect, MakeRandomEffect(effect->description().random_law, model)};
    const Amplitude amplitude = random.law->amplitude();
    // Recordings of one plate position show the same texture: their differences are uninformative
    // about its strength.
    const bool of_places = amplitude == Amplitude::kReflectance;
    if (strong && !of_places) {
      (amplitude == Amplitude::kShift ? strong_movement : strong_light).push_back(random);
      continue;
    }
    found[effect] =
        EvaluateRandomEffect(basis, *effect, *random.law, random.law->StartNear(null.parameters))
            .candidate;
    if (of_places && found[effect].fit.chi_squared < kStrongTextureLeaves * null.chi_squared) {
      strong_reflectance.push_back(random);
    }
  }
  for (const auto& family : {strong_light, strong_movement, strong_reflectance}) {
    if (family.empty()) continue;
    for (RandomEffectCandidate& candidate : EvaluateStrong(model, null, family)) {
      found[candidate.effect] = std::move(candidate);
    }
  }
  std::vector<RandomEffectCandidate> candidates;
  for (const Effect* effect : effects) {
    if (!HasRandomLaw(*effect)) continue;
    // If recordings of one position agree already, there are no phases to follow.
    if (!perhaps_strong) found[effect].phases_rad.clear();
    if (!found[effect].phases_rad.empty()) FollowPhases(model, null, found[effect]);
    candidates.push_back(std::move(found[effect]));
  }
  return candidates;
}

}  // namespace sightline
