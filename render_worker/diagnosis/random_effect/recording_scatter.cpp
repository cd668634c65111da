// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/random_effect/recording_scatter.h"

#include <algorithm>
#include <array>
#include <map>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/expectation/texture_law.h"
#include "render_worker/diagnosis/random_effect/realisation.h"
#include "render_worker/diagnosis/random_effect/scatter_evaluation.h"
#include "render_worker/diagnosis/random_effect/vibration_phases.h"

namespace sightline {
namespace {

// Of the null's chi squared what texture leaves where it is all that is missing and so strong that
// reflectances are far from linear.
constexpr double kStrongTextureLeaves = 0.5;

bool Moves(const Effect& effect) {
  return effect.description().id == kVibration || effect.description().id == "unknown.movement";
}

// Known parameters of `null` at a realisation, from what does not compare speckle; linearised with
// all entries. `start`: without the realisation.
FitResult FitAtRealisation(const SetModel& model, const FitResult& null, SetParameters start,
                           const Realisation& realisation, std::vector<FitSettings::Round> rounds) {
  const RealisedEffect realised(realisation);
  start.effects.push_back({&realised, {}});
  FitSettings settings;
  settings.rounds = std::move(rounds);
  for (int e = 0; e < model.entries(); ++e) {
    settings.use_entry.push_back(!model.ComparesSpeckle(e));
  }
  const SetParameters found = FitSet(model, start, null.free, settings, nullptr).parameters;
  settings.use_entry.clear();
  settings.rounds.assign(1, FitSettings::Round());
  settings.max_iterations = 0;
  FitResult fit = FitSet(model, found, null.free, settings, nullptr);
  fit.parameters.effects.pop_back();
  return fit;
}

// Where what was drawn is so strong that it leads the null model's parameters astray: these and
// what was drawn are found in turn. `effects` draw the same (light, movement or reflectance) by
// different laws, which are compared about one fit: they are to differ by what they say of the
// draws only.
std::vector<ScatterCandidate> EvaluateStrong(const SetModel& model, const FitResult& null,
                                             const std::vector<const Effect*>& effects) {
  SetParameters start;
  start.effects = null.parameters.effects;
  Realisation at(model.set().frames.size());
  const bool moves = Moves(*effects[0]);
  if (moves) {
    at = LineMovements(model, start);
  } else if (IsTexture(effects[0]->description().id)) {
    at = RealisedReflectance(model, ReflectanceExcesses(model, start));
  } else {
    at.light_relative = LightExcesses(model, start);
  }
  std::vector<FitSettings::Round> rounds = {{0.3, 0.3}, {0.1, 0.3}, {0.01, 0.1}, {0, 0}};
  std::vector<ScatterCandidate> best(effects.size());
  double cost = 0;
  const int most_turns = null.parameters.effects.empty() ? 4 : 2;
  for (int turn = 0; turn < most_turns; ++turn) {
    const FitResult about = FitAtRealisation(model, null, start, at, rounds);
    RecordingScatter scatter(model, about, at, null);
    std::vector<ScatterCandidate> candidates;
    candidates.reserve(effects.size());
    std::vector<Realisation> led_to(effects.size(), at);
    size_t leading = 0;
    for (size_t i = 0; i < effects.size(); ++i) {
      candidates.push_back(scatter.Evaluate(*effects[i], led_to[i]));
      // A vibration is followed from where it has led by itself.
      const bool better = candidates[i].log_evidence > candidates[leading].log_evidence;
      if (i == 0 || (better && !moves)) leading = i;
    }
    const double cost_of_turn = TwiceCost(candidates[leading].fit);
    const double gained = turn == 0 ? 0 : cost - cost_of_turn;
    if (turn == 0 || gained > 0) {
      cost = cost_of_turn;
      start = candidates[leading].fit.parameters;
      start.effects.pop_back();
      at = led_to[leading];
      best = std::move(candidates);
    }
    if (turn > 0 && gained < 1) break;
    rounds = {{0, 0.1}, {0, 0}};
    if (!moves) continue;
    // What no uncertainty of a position allows has been movement.
    const double allowed_px = 3 * model.set().description.uncertainty.line_position_each_px;
    for (auto& [id, shift_px] : start.line_shift_px) {
      const double held_px = std::clamp(shift_px, -allowed_px, allowed_px);
      for (size_t f = 0; f < at.shift_px.size(); ++f) {
        if (model.set().frames[f].plate_position_id == id) at.shift_px[f] += shift_px - held_px;
      }
      shift_px = held_px;
    }
  }
  return best;
}

// Normal amplitudes and a symmetric blur are left behind where single recordings show more.
void FollowPhases(const SetModel& model, const FitResult& null, ScatterCandidate& candidate) {
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

constexpr std::array<std::string_view, 8> kKnown = {
    "illumination.power_noise",    "time.exposure_jitter",
    "surface.albedo_texture",      kVibration,
    "unknown.power_scatter",       "unknown.exposure_scatter",
    "unknown.reflectance_scatter", "unknown.movement"};

}  // namespace

// So much that the null model's parameters may have been led astray by it.
bool ScattersStrongly(const SetModel& model, const FitResult& fit) {
  double chi_squared = 0, count = 0;
  for (int e = 0; e < model.entries(); ++e) {
    if (!model.ComparesSpeckle(e)) continue;
    chi_squared += fit.residual[e].squaredNorm();
    count += static_cast<double>(fit.residual[e].size());
  }
  return chi_squared > 10 * count;
}

bool IsRecordingScatter(const Effect& effect) {
  return std::find(kKnown.begin(), kKnown.end(), effect.description().id) != kKnown.end();
}

std::vector<ScatterCandidate> CompareRecordingScatter(const SetModel& model, const FitResult& null,
                                                      std::span<const Effect* const> effects,
                                                      bool perhaps_strong) {
  const bool strong = perhaps_strong && ScattersStrongly(model, null);
  const Realisation none(model.set().frames.size());
  RecordingScatter scatter(model, null, none, null);
  std::vector<const Effect*> strong_light, strong_movement, strong_reflectance;
  std::map<const Effect*, ScatterCandidate> found;
  for (const Effect* effect : effects) {
    if (!IsRecordingScatter(*effect)) continue;
    const bool of_places = IsTexture(effect->description().id);
    if (strong && !of_places) {
      (Moves(*effect) ? strong_movement : strong_light).push_back(effect);
      continue;
    }
    Realisation at = none;
    if (Moves(*effect)) at.shift_px = DisplacementsAtPositions(model, null.parameters);
    found[effect] = scatter.Evaluate(*effect, at);
    // Places differ: recordings of one tell nothing of how much.
    if (of_places && found[effect].fit.chi_squared < kStrongTextureLeaves * null.chi_squared) {
      strong_reflectance.push_back(effect);
    }
  }
  for (const auto& family : {strong_light, strong_movement, strong_reflectance}) {
    if (family.empty()) continue;
    for (ScatterCandidate& candidate : EvaluateStrong(model, null, family)) {
      found[candidate.effect] = std::move(candidate);
    }
  }
  std::vector<ScatterCandidate> candidates;
  for (const Effect* effect : effects) {
    if (!IsRecordingScatter(*effect)) continue;
    // Where something else has made recordings of one place agree, there is nothing to follow.
    if (!perhaps_strong) found[effect].phases_rad.clear();
    if (!found[effect].phases_rad.empty()) FollowPhases(model, null, found[effect]);
    candidates.push_back(std::move(found[effect]));
  }
  return candidates;
}

}  // namespace sightline
