// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/diagnose.h"

#include <algorithm>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "render_worker/diagnosis/finding/calibrated_set.h"
#include "render_worker/diagnosis/finding/describe_fit.h"
#include "render_worker/diagnosis/finding/explanations.h"
#include "render_worker/diagnosis/finding/finding_text.h"
#include "render_worker/diagnosis/finding/pictures.h"
#include "render_worker/diagnosis/finding/residual_law.h"
#include "render_worker/diagnosis/free_form/free_form.h"
#include "render_worker/diagnosis/selection/competition.h"
#include "render_worker/diagnosis/selection/next_recording.h"

namespace sightline {

namespace {

constexpr int kLeastPositions = 4;  // of the plate: fewer say nothing over so many unknowns
constexpr int kProfiles = 4;

absl::Status CheckEnough(const RecordedSet& set) {
  std::set<int> positions;
  for (const RecordedFrame& frame : set.frames) {
    if (frame.plate_position_id >= 0) positions.insert(frame.plate_position_id);
  }
  if (static_cast<int>(positions.size()) < kLeastPositions) {
    return absl::FailedPreconditionError(absl::StrCat(
        set.description.name, ": recordings: ", positions.size(),
        " plate positions with the laser on; the diagnosis needs at least ", kLeastPositions,
        " (plate_position_id), since speckle of one position says nothing about others"));
  }
  return absl::OkStatus();
}

std::vector<const Effect*> EffectsToConsider(const std::vector<std::string>& excluded) {
  std::vector<const Effect*> effects;
  for (const Effect* effect : AllEffects()) {
    const std::string_view id = effect->description().id;
    // Not in the recordings format's vocabulary: a plate cannot tell them.
    if (id == "optics.tangential_distortion" || id == "optics.natural_vignetting") continue;
    if (std::find(excluded.begin(), excluded.end(), id) == excluded.end()) {
      effects.push_back(effect);
    }
  }
  return effects;
}

// What is known of a competition that was stopped at the fraction `done`. No calibrated set: nobody
// should render or plan with values that may still change.
v1::Diagnosis DescribeUnfinished(const SetModel& model, const Competition& competition,
                                 size_t effects, double done, uint64_t seed) {
  v1::Diagnosis diagnosis;
  diagnosis.set_set(model.set().description.name);
  diagnosis.set_seed(static_cast<int64_t>(seed));
  diagnosis.set_verdict("interrupted");
  AddUnfinished(model, competition, &diagnosis);
  *diagnosis.mutable_null_fit() = DescribeFit(model, competition.null);
  const Candidate& best = competition.ranked.front();
  if (!best.effects.empty()) *diagnosis.mutable_model_fit() = DescribeFit(model, best.fit);
  std::string so_far = "nothing was fitted yet";
  if (!best.effects.empty()) {
    so_far = absl::StrFormat("so far %s explains most, %.3g nats better than no effect",
                             diagnosis.ranked(0).effect(), best.log_evidence);
  } else if (competition.ranked.size() > 1) {
    so_far = "so far no effect explains the recordings better than none";
  }
  diagnosis.set_finding(absl::StrFormat(
      "Interrupted after %.0f %% of the comparison of %d effects: %s. This is no finding: nothing "
      "has been held to recordings that were not fitted.",
      100 * done, effects, so_far));
  return diagnosis;
}

}  // namespace

absl::StatusOr<v1::Diagnosis> Diagnose(const RecordedSet& set, const DiagnosisSettings& settings,
                                       const DiagnosisProgress& progress) {
  for (const std::string& id : settings.excluded_effects) {
    if (FindEffect(id) == nullptr) {
      return absl::InvalidArgumentError(
          absl::StrCat("excluded_effects: \"", id, "\" is not an effect"));
    }
  }
  if (const absl::Status enough = CheckEnough(set); !enough.ok()) return enough;
  const absl::Status cancelled = absl::CancelledError("diagnosis cancelled");
  const auto report = [&](double fraction, std::string_view what) {
    return !progress || progress(fraction, what);
  };

  if (!report(0, "reading statistics")) return cancelled;
  SetModelSettings model_settings;
  model_settings.threads = settings.threads;
  const SetModel model(set, model_settings);
  if (!report(0.02, "fitting known parameters")) return cancelled;
  SetParameters start;
  start.line_shift_px = model.EstimateLineShifts(start);
  const FitResult null = FitSet(model, start, {}, {}, nullptr);

  CompetitionSettings competition_settings;
  const std::vector<const Effect*> effects = EffectsToConsider(settings.excluded_effects);
  competition_settings.effects = effects;
  competition_settings.free_forms = FreeFormTerms();
  competition_settings.max_effects = settings.max_effects;
  competition_settings.seed = settings.seed;
  double done = 0;
  const Competition competition = Compete(model, null, competition_settings, [&](double fraction) {
    done = fraction;
    return report(0.1 + 0.8 * fraction, "comparing explanations");
  });
  if (!competition.finished) {
    return DescribeUnfinished(model, competition, effects.size(), done, settings.seed);
  }
  report(0.92, "describing");

  const Candidate& best = competition.ranked.front();
  v1::Diagnosis diagnosis;
  diagnosis.set_set(set.description.name);
  diagnosis.set_seed(static_cast<int64_t>(settings.seed));
  AddExplanations(model, competition, settings.seed, &diagnosis);
  diagnosis.set_verdict(diagnosis.ranked(0).effect() == "none" ? "none" : "effect");
  *diagnosis.mutable_held_out_improvement() =
      DescribeImprovement(model, competition.null, best.fit, settings.seed);
  *diagnosis.mutable_null_check() = DescribeCheck(competition.null_check, competition.null_check);
  *diagnosis.mutable_named_check() = DescribeCheck(competition.named_check, competition.null_check);
  if (IsFreeForm(best)) {
    for (size_t i = 0; i < competition.named.effects.size(); ++i) {
      *diagnosis.add_part_of_it() = DescribeEffect(model, competition.named, i);
    }
  }
  *diagnosis.mutable_null_fit() = DescribeFit(model, competition.null);
  *diagnosis.mutable_model_fit() = DescribeFit(model, best.fit);
  AddStages(competition, &diagnosis);
  if (!best.effects.empty()) {
    AddLaws(model, competition.null, best.fit, settings.seed, &diagnosis);
  }
  AddPower(competition, &diagnosis);
  for (int recording : TellingRecordings(model, competition.null, best.fit, kProfiles)) {
    *diagnosis.add_profiles() = CompareProfiles(model, competition.null, best.fit, recording);
    v1::RegionMap map = MapRegions(model, competition.null, best.fit, recording);
    if (map.rows() > 0) *diagnosis.add_region_maps() = std::move(map);
  }
  if (competition.ranked.size() > 1) {
    for (v1::NextRecording& next : NextRecordings(set, best, competition.ranked[1], 3)) {
      *diagnosis.add_next_recordings() = std::move(next);
    }
  }
  if (IsFreeForm(best)) {
    const ActiveEffect& term = best.effects.back();
    *diagnosis.mutable_free_form() =
        DescribeFreeForm(*term.effect, term.parameters, CoefficientCovariance(best));
    if (diagnosis.laws_size() > 0) diagnosis.mutable_free_form()->set_law(diagnosis.laws(0).law());
    diagnosis.add_warnings(
        "The free-form term is not among the calibrated effects: renderers do not know it.");
  }
  RecordingSet calibrated = CalibratedSet(set.description, best.fit);
  *diagnosis.mutable_calibrated() = RecordingsToProto(calibrated);
  for (const ActiveEffect& active : best.effects) {
    if (IsFreeForm(best)) break;
    v1::Effect* effect = diagnosis.add_calibrated_effects();
    effect->set_effect(std::string(active.effect->description().id));
    for (size_t k = 0; k < active.parameters.size(); ++k) {
      (*effect
            ->mutable_parameters())[std::string(active.effect->description().parameters[k].name)] =
          active.parameters[k];
    }
  }
  const double p_value = diagnosis.model_fit().p_value();
  if (p_value < 1e-3) {
    diagnosis.add_warnings(absl::StrFormat(
        "Even the best explanation does not describe the recordings fully: chi squared %.4g for "
        "%d numbers (%s).",
        best.fit.chi_squared, best.fit.data_count,
        p_value > 0 ? absl::StrFormat("p = %.1e", p_value) : "p < 1e-300"));
  }
  diagnosis.set_finding(FindingText(best, diagnosis));
  report(1, "done");
  return diagnosis;
}

}  // namespace sightline
