// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/diagnose.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/status/status_macros.h"
#include "render_worker/calibration/inspection_change.h"
#include "render_worker/diagnosis/finding/appearance.h"
#include "render_worker/diagnosis/finding/calibrated_set.h"
#include "render_worker/diagnosis/finding/describe_fit.h"
#include "render_worker/diagnosis/finding/describe_term.h"
#include "render_worker/diagnosis/finding/explanations.h"
#include "render_worker/diagnosis/finding/finding_text.h"
#include "render_worker/diagnosis/finding/pictures.h"
#include "render_worker/diagnosis/finding/residual_law.h"
#include "render_worker/diagnosis/fit/fit_quality.h"
#include "render_worker/diagnosis/selection/compare_models.h"
#include "render_worker/diagnosis/selection/evident_effects.h"
#include "render_worker/diagnosis/selection/next_recording.h"
#include "render_worker/effects/discrepancy/free_form.h"
#include "render_worker/effects/plates_in_poses.h"

namespace sightline {

namespace {

// Number of plate positions; the speckle of fewer does not determine so many parameters.
constexpr int kLeastPositions = 4;
constexpr int kProfiles = 4;        // recordings with pictures in the report
constexpr int kNextRecordings = 3;  // recordings to make next that are proposed at most
constexpr double kMisfit = 1e-3;  // p-value below which a warning says that the best model misfits

// Poses with a power that is not stated (PowerDeviation), as without exposure times.
bool LightIsUnknown(const RecordedSet& set) {
  return set.description.posed && set.description.uncertainty.power_relative >= 1;
}

// True if in every recording of a line one pixel of ten columns or more has the largest number.
bool AllLinesAreClipped(const RecordedSet& set) {
  return std::all_of(set.frames.begin(), set.frames.end(), [](const RecordedFrame& frame) {
    if (frame.plate_position_id < 0) return true;
    const auto largest = static_cast<uint16_t>(frame.nominal.sensor.largest_dn());
    const auto clipped =
        std::count(frame.raw_dn.values.begin(), frame.raw_dn.values.end(), largest);
    return 10 * clipped >= frame.raw_dn.columns_px;
  });
}

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
  if (LightIsUnknown(set) && AllLinesAreClipped(set)) {
    return absl::FailedPreconditionError(absl::StrCat(
        set.description.name,
        ": recordings: all lines are clipped, and neither laser power nor exposure times are "
        "stated: height and shape of the line are not known, and any effect would be a guess. "
        "Record exposures that do not clip, or state laser.power_w and exposure_time_s"));
  }
  return absl::OkStatus();
}

bool CanShow(const RecordedSet& set, const EffectDescription& description) {
  return description.plates_can_show_it && (!set.description.posed || PosesCanShow(description)) &&
         (!LightIsUnknown(set) || UnknownLightCanShow(description));
}

// FAILED_PRECONDITION: the description without effects has no fit. A comparison about it would
// compare numbers that are none, and find nothing.
absl::Status CheckFit(const RecordedSet& set, const FitResult& null) {
  if (std::isfinite(null.chi_squared) && null.covariance.allFinite()) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(
      set.description.name,
      ": the recordings are too far from their description for a fit of its values; state more of "
      "them, above all laser.power_w, laser.divergence_rad, exposure_time_s and f_number"));
}

std::vector<const Effect*> TermsToConsider(const RecordedSet& set) {
  std::vector<const Effect*> terms(FreeFormTerms().begin(), FreeFormTerms().end());
  std::erase_if(terms, [&](const Effect* term) { return !CanShow(set, term->description()); });
  return terms;
}

std::vector<const Effect*> EffectsToConsider(const RecordedSet& set,
                                             const std::vector<std::string>& excluded) {
  std::vector<const Effect*> effects;
  for (const Effect* effect : AllEffects()) {
    const EffectDescription& description = effect->description();
    if (!CanShow(set, description)) continue;
    if (std::find(excluded.begin(), excluded.end(), description.id) == excluded.end()) {
      effects.push_back(effect);
    }
  }
  return effects;
}

// Describes a model comparison that was stopped at the fraction `done`. It has no calibrated set,
// since values that may still change must not be used for rendering or planning.
v1::Diagnosis DescribeUnfinished(const SetModel& model, const ModelComparison& comparison,
                                 size_t effects, double done, uint64_t seed) {
  v1::Diagnosis diagnosis;
  diagnosis.set_set(model.set().description.name);
  diagnosis.set_seed(static_cast<int64_t>(seed));
  diagnosis.set_verdict("interrupted");
  AddUnfinished(model, comparison, &diagnosis);
  *diagnosis.mutable_null_fit() = DescribeFit(model, comparison.null);
  const Hypothesis& best = comparison.ranked.front();
  if (!best.effects.empty()) *diagnosis.mutable_model_fit() = DescribeFit(model, best.fit);
  std::string so_far = "nothing was fitted yet";
  if (!best.effects.empty()) {
    so_far = absl::StrFormat("so far %s explains most, %.3g nats better than no effect",
                             diagnosis.ranked(0).effect(), best.log_evidence);
  } else if (comparison.ranked.size() > 1) {
    so_far = "so far no effect explains the recordings better than none";
  }
  diagnosis.set_finding(absl::StrFormat(
      "Interrupted after %.0f %% of the comparison of %d effects: %s. This is no finding: nothing "
      "has been held to recordings that were not fitted.",
      100 * done, effects, so_far));
  return diagnosis;
}

// Profiles and maps of the recordings that distinguish the best model most from the null model.
void AddPictures(const SetModel& model, const ModelComparison& comparison, const FitResult& best,
                 v1::Diagnosis* diagnosis) {
  for (int recording : TellingRecordings(model, comparison.null, best, kProfiles)) {
    *diagnosis->add_profiles() = CompareProfiles(model, comparison.null, best, recording);
    v1::RegionMap map = MapRegions(model, comparison.null, best, recording);
    if (map.rows() > 0) *diagnosis->add_region_maps() = std::move(map);
  }
}

// The curves of the model-discrepancy terms of the answer.
void AddFreeForms(const Hypothesis& best, v1::Diagnosis* diagnosis) {
  for (size_t e = 0; e < best.effects.size(); ++e) {
    const ActiveEffect& term = best.effects[e];
    if (!IsFreeForm(*term.effect)) continue;
    v1::FreeFormTerm* described = diagnosis->has_free_form() ? diagnosis->add_further_free_forms()
                                                             : diagnosis->mutable_free_form();
    *described = DescribeFreeForm(*term.effect, term.parameters, CoefficientCovariance(best, e));
  }
  if (diagnosis->laws_size() > 0) diagnosis->mutable_free_form()->set_law(diagnosis->laws(0).law());
}

// The description with the fitted values, the effects, and how an inspection expresses these.
void AddCalibration(const RecordingSet& nominal, const Hypothesis& best,
                    const std::vector<ActiveEffect>& evident, v1::Diagnosis* diagnosis) {
  *diagnosis->mutable_calibrated() = RecordingsToProto(CalibratedSet(nominal, best.fit));
  std::vector<ActiveEffect> effects = best.effects;
  effects.insert(effects.end(), evident.begin(), evident.end());
  for (const ActiveEffect& active : effects) {
    const EffectDescription& description = active.effect->description();
    v1::Effect* effect = diagnosis->add_calibrated_effects();
    effect->set_effect(std::string(description.id));
    for (size_t k = 0; k < active.parameters.size(); ++k) {
      (*effect->mutable_parameters())[std::string(description.parameters[k].name)] =
          active.parameters[k];
    }
    if (IsFreeForm(*active.effect)) {
      AddWithoutField(std::string(description.id), diagnosis);
    } else {
      AddInspectionChanges(active, nominal, diagnosis);
    }
  }
}

void WarnOfMisfit(const FitResult& best, v1::Diagnosis* diagnosis) {
  const double p_value = diagnosis->model_fit().p_value();
  if (!(p_value < kMisfit)) return;
  diagnosis->add_warnings(absl::StrFormat(
      "Even the best explanation does not describe the recordings fully: chi squared %.4g for "
      "%d numbers (%s).",
      best.chi_squared, best.data_count,
      p_value > 0 ? absl::StrFormat("p = %.1e", p_value) : "p < 1e-300"));
}

// `nominal`: the fit of a model without any effect, evident ones included.
v1::Diagnosis DescribeFinished(const SetModel& model, const FitResult& nominal,
                               const ModelComparison& comparison, uint64_t seed) {
  const RecordedSet& set = model.set();
  const Hypothesis& best = comparison.ranked.front();
  v1::Diagnosis diagnosis;
  diagnosis.set_set(set.description.name);
  diagnosis.set_seed(static_cast<int64_t>(seed));
  AddExplanations(model, comparison, seed, &diagnosis);
  diagnosis.set_verdict(diagnosis.ranked(0).effect() == "none" ? "none" : "effect");
  diagnosis.set_corrected_by_renderings(comparison.rendered);
  *diagnosis.mutable_held_out_improvement() = DescribeImprovement(model, nominal, best.fit, seed);
  if (!comparison.evident.empty() && diagnosis.has_remainder()) {
    // It is stated over a null model that has the evident effects; the answer is over one without.
    const double nominal_excess = diagnosis.held_out_improvement().null() - 1;
    const PredictedFit with_evident = CrossValidate(model, comparison.null, seed);
    const double excess =
        with_evident.chi_squared / std::max(1, with_evident.degrees_of_freedom) - 1;
    const double part = nominal_excess > 0 ? std::clamp(excess / nominal_excess, 0.0, 1.0) : 1;
    diagnosis.mutable_remainder()->set_share(part * diagnosis.remainder().share());
  }
  const PredictiveCheck null_check = comparison.evident.empty()
                                         ? comparison.null_check
                                         : CheckPredictions(model, nominal, nominal, seed);
  *diagnosis.mutable_null_check() = DescribeCheck(null_check, null_check);
  *diagnosis.mutable_named_check() = DescribeCheck(comparison.named_check, null_check);
  if (IsFreeForm(best)) {
    for (size_t i = 0; i < comparison.named.effects.size(); ++i) {
      *diagnosis.add_part_of_it() = DescribeEffect(model, comparison.named, i);
    }
    for (const ActiveEffect& evident : comparison.evident) {
      *diagnosis.add_part_of_it() = DescribeEffect(evident);
    }
  }
  *diagnosis.mutable_null_fit() = DescribeFit(model, nominal);
  *diagnosis.mutable_model_fit() = DescribeFit(model, best.fit);
  AddStages(comparison, &diagnosis);
  if (!best.effects.empty()) AddLaws(model, comparison.null, best.fit, seed, &diagnosis);
  AddPower(comparison, &diagnosis);
  AddPictures(model, comparison, best.fit, &diagnosis);
  if (comparison.ranked.size() > 1) {
    for (v1::NextRecording& next :
         NextRecordings(set, best, comparison.ranked[1], kNextRecordings)) {
      *diagnosis.add_next_recordings() = std::move(next);
    }
  }
  if (IsFreeForm(best)) AddFreeForms(best, &diagnosis);
  AddCalibration(set.description, best, comparison.evident, &diagnosis);
  WarnOfMisfit(best.fit, &diagnosis);
  diagnosis.set_finding(FindingText(best, diagnosis));
  const std::string appearance = AppearanceText(comparison, diagnosis);
  if (!appearance.empty()) diagnosis.mutable_finding()->append("\n" + appearance);
  return diagnosis;
}

// The fit of the nominal description without any effect.
FitResult NominalFit(const RecordedSet& set, SetModelSettings settings,
                     const SetParameters& start) {
  settings.present_effects.clear();
  return FitSet(SetModel(set, settings), start, {}, {}, nullptr);
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
  SIGHTLINE_RETURN_IF_ERROR(CheckEnough(set));
  const absl::Status cancelled = absl::CancelledError("diagnosis cancelled");
  const auto report = [&](double fraction, std::string_view what) {
    return !progress || progress(fraction, what);
  };

  if (!report(0, "reading statistics")) return cancelled;
  std::vector<const Effect*> effects = EffectsToConsider(set, settings.excluded_effects);
  SetModelSettings model_settings;
  model_settings.threads = settings.threads;
  // Recordings of plates in poses are segments already.
  if (set.description.posed) model_settings.blocks_along_line = 1;
  model_settings.present_effects = EvidentEffects(set, effects);
  const std::vector<ActiveEffect>& evident = model_settings.present_effects;
  const SetModel model(set, model_settings);
  if (!report(0.02, "fitting known parameters")) return cancelled;
  SetParameters start;
  start.line_shift_px = EstimateLineShifts(model, start);
  const FitResult null = FitSet(model, start, {}, {}, nullptr);
  SIGHTLINE_RETURN_IF_ERROR(CheckFit(set, null));

  ComparisonSettings comparison_settings;
  std::erase_if(effects, [&](const Effect* effect) {
    return std::any_of(evident.begin(), evident.end(),
                       [&](const ActiveEffect& active) { return active.effect == effect; });
  });
  comparison_settings.effects = effects;
  const std::vector<const Effect*> terms = TermsToConsider(set);
  comparison_settings.free_forms = terms;
  comparison_settings.max_effects = settings.max_effects;
  comparison_settings.seed = settings.seed;
  double done = 0;
  ModelComparison comparison =
      CompareModels(model, null, comparison_settings, [&](double fraction) {
        done = fraction;
        return report(0.1 + 0.8 * fraction, "comparing explanations");
      });
  comparison.evident = evident;
  if (!comparison.finished) {
    return DescribeUnfinished(model, comparison, effects.size(), done, settings.seed);
  }
  report(0.92, "describing");

  v1::Diagnosis diagnosis = DescribeFinished(
      model, evident.empty() ? comparison.null : NominalFit(set, model_settings, start), comparison,
      settings.seed);
  if (LightIsUnknown(set)) {
    diagnosis.add_warnings(
        "Laser power and exposure times are not stated: errors of power, f-number, focus, gain, "
        "reflectance and dark signal, and the sensor's response, are not considered. Recordings of "
        "one unknown amount of light cannot show them. Other light cannot be told from a dark "
        "level.");
  }
  report(1, "done");
  return diagnosis;
}

}  // namespace sightline
