#include "render_worker/diagnosis/diagnose.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "render_worker/diagnosis/calibrated_set.h"
#include "render_worker/diagnosis/competition.h"
#include "render_worker/diagnosis/effect_signature.h"
#include "render_worker/diagnosis/fit_quality.h"
#include "render_worker/diagnosis/free_form.h"
#include "render_worker/diagnosis/next_recording.h"
#include "render_worker/diagnosis/pictures.h"
#include "render_worker/diagnosis/recording_scatter.h"
#include "render_worker/diagnosis/setup_law.h"

namespace sightline {

namespace {

constexpr int kLeastPositions = 4;  // of the plate: fewer say nothing over so many unknowns
constexpr int kProfiles = 4;
// Of a colour sensor's efficiency for other light than the laser's, which its description does not
// give: the radiance of that light is known as badly.
constexpr double kEfficiencyError = 0.4;

std::string Text(std::string_view text) { return std::string(text); }

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

v1::FittedEffect DescribeEffect(const SetModel& model, const Candidate& candidate, size_t index) {
  const ActiveEffect& active = candidate.effects[index];
  const bool colour =
      model.set().frames.front().nominal.sensor.colour_filter != ColourFilter::kMono;
  const EffectDescription& description = active.effect->description();
  v1::FittedEffect fitted;
  fitted.set_effect(Text(description.id));
  fitted.set_stage(Text(StageName(description.stage)));
  for (size_t k = 0; k < description.parameters.size(); ++k) {
    const EffectParameter& parameter = description.parameters[k];
    v1::FittedParameter* value = fitted.add_parameters();
    value->set_name(Text(parameter.name));
    value->set_value(active.parameters[k]);
    value->set_lower(active.parameters[k]);
    value->set_upper(active.parameters[k]);
    for (size_t f = 0; f < candidate.free.size(); ++f) {
      const FreeEffectParameter& free = candidate.free[f];
      if (free.effect != static_cast<int>(index) || free.parameter != static_cast<int>(k)) continue;
      // The change an effect makes is itself known to a part only.
      const double model_error =
          colour && parameter.name == "ambient_radiance_w_m2_sr" ? kEfficiencyError : kEffectError;
      const double error = std::hypot(candidate.fit.effect_standard_errors[f],
                                      model_error * (active.parameters[k] - parameter.null_value));
      value->set_standard_error(error);
      value->set_lower(std::max(parameter.lower, active.parameters[k] - 1.96 * error));
      value->set_upper(std::min(parameter.upper, active.parameters[k] + 1.96 * error));
    }
  }
  const EffectSignature signature = SignatureOf(description.id);
  for (std::string_view region : signature.regions) fitted.add_regions(Text(region));
  for (std::string_view quantity : signature.depends_on) fitted.add_depends_on(Text(quantity));
  return fitted;
}

// Of a free-form term's coefficients, in their units; those that are not needed are known.
Eigen::MatrixXd CoefficientCovariance(const Candidate& candidate) {
  const ActiveEffect& term = candidate.effects.back();
  const auto coefficients = static_cast<Eigen::Index>(term.parameters.size());
  const auto free = static_cast<Eigen::Index>(candidate.free.size());
  const FitResult& fit = candidate.fit;
  if (IsRecordingScatter(*term.effect)) {
    // What was drawn is in the fit, not its law.
    return Eigen::Map<const Eigen::VectorXd>(fit.effect_standard_errors.data(), free)
        .tail(coefficients)
        .cwiseAbs2()
        .asDiagonal();
  }
  // Free forms are linear.
  Eigen::MatrixXd slopes = Eigen::MatrixXd::Zero(coefficients, free);
  for (Eigen::Index f = 0; f < free; ++f) {
    const auto [effect, parameter] = candidate.free[static_cast<size_t>(f)];
    if (candidate.effects[effect].effect != term.effect) continue;
    slopes(parameter, f) = term.effect->description().parameters[parameter].prior_scale;
  }
  return slopes * fit.covariance.bottomRightCorner(free, free) * slopes.transpose();
}

// The effect that explains more by itself first.
std::vector<size_t> Leading(const Candidate& candidate, const Competition& competition) {
  std::vector<size_t> order(candidate.effects.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  const auto alone = [&](size_t i) {
    for (const Candidate& single : competition.ranked) {
      if (single.effects.size() == 1 && single.effects[0].effect == candidate.effects[i].effect) {
        return single.log_evidence;
      }
    }
    return -1e300;  // not even fitted
  };
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return alone(a) > alone(b); });
  return order;
}

std::string NameOf(const Candidate& candidate, const Competition& competition) {
  if (candidate.effects.empty()) return "none";
  if (IsFreeForm(candidate)) return "unknown";
  return Text(candidate.effects[Leading(candidate, competition).front()].effect->description().id);
}

std::string ReasonFor(const Candidate& candidate, const Candidate& best, bool same_class) {
  if (&candidate == &best) return "describes the recordings best";
  const double behind =
      best.log_evidence + best.log_prior - candidate.log_evidence - candidate.log_prior;
  if (same_class) return "changes these recordings in the same way";
  const double chi = candidate.fit.chi_squared - best.fit.chi_squared;
  if (behind < 3) return absl::StrFormat("nearly as good: %.1f nats behind", behind);
  if (chi > 3) {
    return absl::StrFormat("leaves chi squared larger by %.3g (%.3g nats behind)", chi, behind);
  }
  return absl::StrFormat("needs more freedom for the same fit (%.3g nats behind)", behind);
}

// Explanations with the same leading effect are one, as the most probable of them has it.
void AddExplanations(const SetModel& model, const Competition& competition, uint64_t seed,
                     v1::Diagnosis* diagnosis) {
  const Candidate& best = competition.ranked.front();
  std::map<std::string, v1::Explanation*> by_name;
  for (const Candidate& candidate : competition.ranked) {
    const std::string name = NameOf(candidate, competition);
    const std::string stage =
        candidate.effects.empty()
            ? "none"
            : Text(StageName(candidate.effects[Leading(candidate, competition).front()]
                                 .effect->description()
                                 .stage));
    v1::Explanation*& explanation = by_name[name == "unknown" ? name + stage : name];
    if (explanation != nullptr) {
      explanation->set_probability(explanation->probability() + candidate.probability);
      continue;
    }
    explanation = diagnosis->add_ranked();
    explanation->set_effect(name);
    explanation->set_stage(stage);
    explanation->set_probability(candidate.probability);
    for (size_t i : Leading(candidate, competition)) {
      if (!IsFreeForm(candidate)) *explanation->add_effects() = DescribeEffect(model, candidate, i);
    }
    explanation->set_log_evidence_gain(candidate.log_evidence);
    const PredictedFit predicted = CrossValidate(model, candidate.fit, seed);
    if (predicted.degrees_of_freedom > 0) {
      explanation->set_held_out_chi_squared_per_dof(predicted.chi_squared /
                                                    predicted.degrees_of_freedom);
    }
    const bool same_class =
        !candidate.effects.empty() &&
        std::find(competition.same_class.begin(), competition.same_class.end(),
                  candidate.effects.front().effect) != competition.same_class.end();
    explanation->set_reason(ReasonFor(candidate, best, same_class));
  }
  std::stable_sort(diagnosis->mutable_ranked()->begin(), diagnosis->mutable_ranked()->end(),
                   [](const v1::Explanation& a, const v1::Explanation& b) {
                     return a.probability() > b.probability();
                   });
  for (const Effect* effect : competition.same_class) {
    diagnosis->add_same_class(Text(effect->description().id));
  }
}

void AddStages(const Competition& competition, v1::Diagnosis* diagnosis) {
  std::map<std::string, std::pair<double, double>> stages;  // gain, probability
  for (const ScreenedEffect& screened : competition.screened) {
    double& gain = stages[Text(StageName(screened.strongest.effect->description().stage))].first;
    gain = std::max(gain, screened.gain);
  }
  for (const Candidate& candidate : competition.ranked) {
    if (candidate.effects.empty()) continue;
    auto& [gain, probability] = stages[Text(StageName(
        candidate.effects[Leading(candidate, competition).front()].effect->description().stage))];
    gain = std::max(gain, candidate.log_evidence);
    probability += candidate.probability;
  }
  for (const auto& [stage, evidence] : stages) {
    v1::StageEvidence* added = diagnosis->add_stages();
    added->set_stage(stage);
    added->set_log_evidence_gain(evidence.first);
    added->set_probability(evidence.second);
  }
}

void AddPower(const Competition& competition, v1::Diagnosis* diagnosis) {
  for (const ScreenedEffect& screened : competition.screened) {
    const EffectDescription& description = screened.strongest.effect->description();
    if (IsFreeForm(*screened.strongest.effect) || screened.detectable <= 0) continue;
    const EffectParameter& parameter = description.parameters[screened.parameter];
    const double up = ParameterFromStandardised(parameter, screened.detectable);
    const double strength = up != parameter.null_value
                                ? up
                                : ParameterFromStandardised(parameter, -screened.detectable);
    v1::DetectableStrength* power = diagnosis->add_power();
    power->set_effect(Text(description.id));
    power->set_parameter(Text(parameter.name));
    power->set_strength(strength);
  }
}

// What remains of the null model's residual in every recording [DN], and what it grows with.
void AddLaws(const SetModel& model, const FitResult& null, const FitResult& best, uint64_t seed,
             v1::Diagnosis* diagnosis) {
  const RecordedSet& set = model.set();
  const size_t frames = set.frames.size();
  std::vector<double> sum(frames, 0), weight(frames, 0);
  for (int e = 0; e < model.entries(); ++e) {
    if (model.StatisticOf(e).name() != "profile") continue;
    for (int row = 0; row < static_cast<int>(null.mean[e].size()); ++row) {
      const int frame = model.FrameOfRow(e, row);
      // Where the two models differ.
      const double change = best.mean[e][row] - null.mean[e][row];
      sum[frame] += change * (model.observed()[e][row] - null.mean[e][row]);
      weight[frame] += change * change;
    }
  }
  std::vector<SetupAmplitude> amplitudes;
  for (size_t f = 0; f < frames; ++f) {
    if (set.frames[f].plate_position_id < 0 || weight[f] <= 0) continue;
    SetupAmplitude amplitude = SetupOf(set.frames[f].nominal);
    // Root mean square of the change [DN], with the sign and size the recording gives it.
    amplitude.amplitude = sum[f] / std::sqrt(weight[f]);
    amplitude.standard_error = 0.1 * std::abs(amplitude.amplitude) + 1e-6;
    amplitudes.push_back(amplitude);
  }
  SetupLawSettings settings;
  settings.seed = seed;
  for (v1::SetupLaw& law : FindSetupLaws(amplitudes, settings)) *diagnosis->add_laws() = law;
}

std::string Percent(double probability) {
  return absl::StrFormat("%.0f %%", 100 * std::min(0.99, probability));
}

void WriteFinding(const Candidate& best, v1::Diagnosis* diagnosis) {
  const v1::Explanation& first = diagnosis->ranked(0);
  const auto chi = [&](double value) { return absl::StrFormat("%.3g", value); };
  const v1::HeldOutImprovement& held_out = diagnosis->held_out_improvement();
  if (first.effect() == "none") {
    diagnosis->set_finding(absl::StrCat(
        "Nothing is missing beyond the stated uncertainties (", Percent(first.probability()),
        "); chi squared per number is ", chi(held_out.null()), " on recordings not fitted."));
    return;
  }
  std::string what;
  if (first.effect() == "unknown") {
    what = absl::StrCat("Something that no known effect describes is missing at the stage \"",
                        first.stage(), "\"");
    if (best.effects.size() > 1) {
      absl::StrAppend(&what, ", near to ", Text(best.effects.front().effect->description().id));
    }
  } else {
    std::vector<std::string> parts;
    for (const v1::FittedEffect& effect : first.effects()) {
      std::string part = effect.effect();
      if (effect.parameters_size() > 0) {
        const v1::FittedParameter& parameter = effect.parameters(0);
        absl::StrAppend(&part, " (", parameter.name(), " = ",
                        absl::StrFormat("%.3g", parameter.value()));
        if (parameter.has_standard_error()) {
          absl::StrAppend(&part, absl::StrFormat(" +- %.1g", parameter.standard_error()));
        }
        absl::StrAppend(&part, ")");
      }
      parts.push_back(std::move(part));
    }
    what = absl::StrCat("The recordings show ", absl::StrJoin(parts, " and "));
    if (diagnosis->same_class_size() > 0) {
      absl::StrAppend(&what, " or what changes them alike (",
                      absl::StrJoin(diagnosis->same_class(), ", "), ")");
    }
  }
  diagnosis->set_finding(
      absl::StrCat(what, ": probability ", Percent(first.probability()),
                   "; chi squared per number on recordings not fitted falls from ",
                   chi(held_out.null()), " to ", chi(held_out.with_effect()), "."));
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
  bool stopped = false;
  const Competition competition = Compete(model, null, competition_settings, [&](double fraction) {
    stopped = !report(0.1 + 0.8 * fraction, "comparing explanations");
    return !stopped;
  });
  if (stopped || !report(0.92, "describing")) return cancelled;

  const Candidate& best = competition.ranked.front();
  v1::Diagnosis diagnosis;
  diagnosis.set_set(set.description.name);
  diagnosis.set_seed(static_cast<int64_t>(settings.seed));
  AddExplanations(model, competition, settings.seed, &diagnosis);
  diagnosis.set_verdict(diagnosis.ranked(0).effect() == "none" ? "none" : "effect");
  *diagnosis.mutable_held_out_improvement() =
      DescribeImprovement(model, competition.null, best.fit, settings.seed);
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
    effect->set_effect(Text(active.effect->description().id));
    for (size_t k = 0; k < active.parameters.size(); ++k) {
      (*effect->mutable_parameters())[Text(active.effect->description().parameters[k].name)] =
          active.parameters[k];
    }
  }
  const double p_value = diagnosis.model_fit().p_value();
  if (p_value < 1e-3) {
    diagnosis.add_warnings(absl::StrFormat(
        "Even the best explanation does not describe the recordings fully: chi squared %.4g for "
        "%d numbers (p = %.1e).",
        best.fit.chi_squared, best.fit.data_count, p_value));
  }
  WriteFinding(best, &diagnosis);
  report(1, "done");
  return diagnosis;
}

}  // namespace sightline
