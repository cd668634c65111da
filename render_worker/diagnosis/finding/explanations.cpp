// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/finding/explanations.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "render_worker/diagnosis/fit/fit_quality.h"
#include "render_worker/diagnosis/fit/model_error.h"
#include "render_worker/diagnosis/random_effect/compare_random_effects.h"
#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/thresholds.h"
#include "render_worker/effects/discrepancy/free_form.h"
#include "render_worker/effects/stage_name.h"
#include "render_worker/evidence/answer_text.h"
#include "render_worker/evidence/evidence.h"
#include "render_worker/evidence/judgement.h"

namespace sightline {

namespace {

// Relative standard uncertainty of a colour sensor's efficiency for light other than the laser's.
// Its description does not state it, so the radiance of that light has the same uncertainty.
constexpr double kEfficiencyError = 0.4;

std::string Text(std::string_view text) { return std::string(text); }

// The effect that explains more by itself first.
std::vector<size_t> Leading(const Hypothesis& hypothesis, const ModelComparison& comparison) {
  std::vector<size_t> order(hypothesis.effects.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  const auto alone = [&](size_t i) {
    for (const Hypothesis& single : comparison.ranked) {
      if (single.effects.size() == 1 && single.effects[0].effect == hypothesis.effects[i].effect) {
        return single.log_evidence;
      }
    }
    return -1e300;  // not even fitted
  };
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return alone(a) > alone(b); });
  return order;
}

std::string NameOf(const Hypothesis& hypothesis, const ModelComparison& comparison) {
  if (hypothesis.effects.empty()) {
    if (comparison.evident.empty()) return "none";
    return Text(comparison.evident.front().effect->description().id);
  }
  if (IsFreeForm(hypothesis)) return "unknown";
  return Text(hypothesis.effects[Leading(hypothesis, comparison).front()].effect->description().id);
}

std::string StageOf(const Hypothesis& hypothesis, const ModelComparison& comparison) {
  if (hypothesis.effects.empty()) {
    if (comparison.evident.empty()) return "none";
    return Text(StageName(comparison.evident.front().effect->description().stage));
  }
  const size_t first = Leading(hypothesis, comparison).front();
  return Text(StageName(hypothesis.effects[first].effect->description().stage));
}

// Score on held-out recordings over that of the named model [nats].
double MoreHeldOutScore(const SetModel& model, const ModelComparison& comparison,
                        const Hypothesis& hypothesis, uint64_t seed) {
  return CheckPredictions(model, hypothesis.fit, comparison.null, seed).log_score -
         comparison.named_check.log_score;
}

// Why a hypothesis with a model-discrepancy term is not the answer, a named model is.
std::string ReasonForTerm(const SetModel& model, const ModelComparison& comparison,
                          const Hypothesis& hypothesis, uint64_t seed) {
  TermOverName term;
  term.more_evidence = hypothesis.log_evidence - comparison.ranked.front().log_evidence;
  if (comparison.remainder) term.share_left = comparison.remainder->share;
  term.share_names_may_leave = comparison.share_names_may_leave;
  if (term.more_evidence > 0 && term.share_left > term.share_names_may_leave) {
    term.more_held_out_score = MoreHeldOutScore(model, comparison, hypothesis, seed);
  }
  return WhyTermDoesNotLead(term);
}

std::string ReasonForAnswer(const ModelComparison& comparison) {
  const Hypothesis& best = comparison.ranked.front();
  const bool most_evidence =
      std::all_of(comparison.ranked.begin(), comparison.ranked.end(),
                  [&](const Hypothesis& h) { return h.log_evidence <= best.log_evidence; });
  return most_evidence ? "describes the recordings best" : "the most probable one";
}

// Why a hypothesis is not the answer, by evidence and prior.
std::string ReasonByEvidence(const ModelComparison& comparison, const Hypothesis& hypothesis) {
  constexpr double kNear_nats = 3;
  const Hypothesis& best = comparison.ranked.front();
  const double behind =
      best.log_evidence + best.log_prior - hypothesis.log_evidence - hypothesis.log_prior;
  const bool named_is_rejected =
      IsFreeForm(best) && comparison.named_check.p_value < kRejectedBelow;
  if (behind < kNear_nats && named_is_rejected && !IsFreeForm(hypothesis)) {
    return absl::StrFormat(
        "recordings that were not fitted reject the best known effect (by evidence and prior %.1f "
        "nats %s)",
        std::abs(behind), behind < 0 ? "ahead" : "behind");
  }
  if (behind < 0) {
    return absl::StrFormat("%.1f nats ahead, which errors of the model itself may cause", -behind);
  }
  if (behind < kNear_nats) return absl::StrFormat("nearly as good: %.1f nats behind", behind);
  const double chi = hypothesis.fit.chi_squared - best.fit.chi_squared;
  if (chi > 3) {
    return absl::StrFormat("leaves chi squared larger by %.3g (%.3g nats behind)", chi, behind);
  }
  return absl::StrFormat("needs more freedom for the same fit (%.3g nats behind)", behind);
}

std::string ReasonFor(const SetModel& model, const ModelComparison& comparison,
                      const Hypothesis& hypothesis, uint64_t seed) {
  const Hypothesis& best = comparison.ranked.front();
  if (hypothesis.effects.empty() && !comparison.evident.empty()) {
    return "evident from the raw numbers";
  }
  if (&hypothesis == &best) return ReasonForAnswer(comparison);
  if (IsFreeForm(hypothesis) && !IsFreeForm(best) && hypothesis.probability == 0) {
    return ReasonForTerm(model, comparison, hypothesis, seed);
  }
  const bool same_class =
      !hypothesis.effects.empty() &&
      std::find(comparison.same_class.begin(), comparison.same_class.end(),
                hypothesis.effects.front().effect) != comparison.same_class.end();
  if (same_class) return "changes these recordings in the same way";
  return ReasonByEvidence(comparison, hypothesis);
}

// The stage of the answer; of unknown physics also the stage that predicts other settings best.
void AddLocatedStages(const ModelComparison& comparison, v1::Diagnosis* diagnosis) {
  if (diagnosis->ranked(0).effect() == "none") return;
  diagnosis->add_located_stages(diagnosis->ranked(0).stage());
  for (const Stage stage : StagesByTransfer(comparison.transfer)) {
    if (diagnosis->located_stages_size() == static_cast<int>(thresholds::kStagesSaid)) break;
    const std::string name = Text(StageName(stage));
    if (name != diagnosis->located_stages(0)) diagnosis->add_located_stages(name);
  }
}

void AddRemainder(const ModelComparison& comparison, v1::Diagnosis* diagnosis) {
  if (!comparison.remainder) return;
  v1::Remainder* remainder = diagnosis->mutable_remainder();
  if (comparison.remainder->term != nullptr) {
    remainder->set_stage(Text(StageName(comparison.remainder->term->description().stage)));
  }
  remainder->set_share(comparison.remainder->share);
  remainder->set_probability(comparison.remainder->probability);
  // Several p-values may be too small for a number: chi squared then decides.
  const std::vector<PredictedGroup>& groups = comparison.named_check.groups;
  const auto per_number = [](const PredictedGroup& group) {
    return group.chi_squared / std::max(1, group.degrees_of_freedom);
  };
  const auto worst = std::min_element(
      groups.begin(), groups.end(), [&](const PredictedGroup& a, const PredictedGroup& b) {
        return a.p_value != b.p_value ? a.p_value < b.p_value : per_number(a) > per_number(b);
      });
  if (worst != groups.end()) remainder->set_group(worst->name);
}

}  // namespace

v1::FittedEffect DescribeEffect(const ActiveEffect& active) {
  const EffectDescription& description = active.effect->description();
  v1::FittedEffect known;
  known.set_effect(Text(description.id));
  known.set_stage(Text(StageName(description.stage)));
  for (size_t k = 0; k < description.parameters.size(); ++k) {
    v1::FittedParameter* value = known.add_parameters();
    value->set_name(Text(description.parameters[k].name));
    value->set_value(active.parameters[k]);
    value->set_lower(active.parameters[k]);
    value->set_upper(active.parameters[k]);
  }
  for (std::string_view region : description.signature.regions) known.add_regions(Text(region));
  for (std::string_view quantity : description.signature.depends_on) {
    known.add_depends_on(Text(quantity));
  }
  return known;
}

v1::FittedEffect DescribeEffect(const SetModel& model, const Hypothesis& hypothesis, size_t index) {
  const ActiveEffect& active = hypothesis.effects[index];
  const bool colour =
      model.set().frames.front().nominal.sensor.colour_filter != ColourFilter::kMono;
  v1::FittedEffect fitted = DescribeEffect(active);
  for (int k = 0; k < fitted.parameters_size(); ++k) {
    const EffectParameter& parameter = active.effect->description().parameters[k];
    v1::FittedParameter* value = fitted.mutable_parameters(k);
    for (size_t f = 0; f < hypothesis.free.size(); ++f) {
      const FreeEffectParameter& free = hypothesis.free[f];
      if (free.effect != static_cast<int>(index) || free.parameter != k) continue;
      // The change an effect makes is itself known to a part only.
      const double model_error =
          colour && parameter.name == "ambient_radiance_w_m2_sr" ? kEfficiencyError : kEffectError;
      const double error = std::hypot(hypothesis.fit.effect_standard_errors[f],
                                      model_error * (active.parameters[k] - parameter.null_value));
      value->set_standard_error(error);
      value->set_lower(std::max(parameter.lower, active.parameters[k] - 1.96 * error));
      value->set_upper(std::min(parameter.upper, active.parameters[k] + 1.96 * error));
    }
  }
  return fitted;
}

Eigen::MatrixXd CoefficientCovariance(const Hypothesis& hypothesis, size_t index) {
  const ActiveEffect& term = hypothesis.effects[index];
  const auto coefficients = static_cast<Eigen::Index>(term.parameters.size());
  const auto free = static_cast<Eigen::Index>(hypothesis.free.size());
  const FitResult& fit = hypothesis.fit;
  if (HasRandomLaw(*term.effect)) {
    // The fit holds the realised values of the random effect, not the parameters of its
    // distribution.
    Eigen::VectorXd variances = Eigen::VectorXd::Zero(coefficients);
    for (Eigen::Index f = 0; f < free; ++f) {
      const auto [effect, parameter] = hypothesis.free[static_cast<size_t>(f)];
      const double error = fit.effect_standard_errors[static_cast<size_t>(f)];
      if (hypothesis.effects[effect].effect == term.effect) variances[parameter] = error * error;
    }
    return variances.asDiagonal();
  }
  // Free forms are linear.
  Eigen::MatrixXd slopes = Eigen::MatrixXd::Zero(coefficients, free);
  for (Eigen::Index f = 0; f < free; ++f) {
    const auto [effect, parameter] = hypothesis.free[static_cast<size_t>(f)];
    if (hypothesis.effects[effect].effect != term.effect) continue;
    slopes(parameter, f) = term.effect->description().parameters[parameter].prior_scale;
  }
  return slopes * fit.covariance.bottomRightCorner(free, free) * slopes.transpose();
}

void AddExplanations(const SetModel& model, const ModelComparison& comparison, uint64_t seed,
                     v1::Diagnosis* diagnosis) {
  std::map<std::string, v1::Explanation*> by_name;
  for (const Hypothesis& hypothesis : comparison.ranked) {
    const std::string name = NameOf(hypothesis, comparison);
    const std::string stage = StageOf(hypothesis, comparison);
    v1::Explanation*& explanation = by_name[name == "unknown" ? name + stage : name];
    if (explanation != nullptr) {
      explanation->set_probability(explanation->probability() + hypothesis.probability);
      continue;
    }
    explanation = diagnosis->add_ranked();
    explanation->set_effect(name);
    explanation->set_stage(stage);
    explanation->set_probability(hypothesis.probability);
    for (size_t i : Leading(hypothesis, comparison)) {
      if (!IsFreeForm(hypothesis))
        *explanation->add_effects() = DescribeEffect(model, hypothesis, i);
    }
    for (const ActiveEffect& evident : comparison.evident) {
      if (!IsFreeForm(hypothesis)) *explanation->add_effects() = DescribeEffect(evident);
    }
    explanation->set_log_evidence_gain(hypothesis.log_evidence);
    const PredictedFit predicted = CrossValidate(model, hypothesis.fit, seed);
    if (predicted.degrees_of_freedom > 0) {
      explanation->set_held_out_chi_squared_per_dof(predicted.chi_squared /
                                                    predicted.degrees_of_freedom);
    }
    *explanation->mutable_evidence() = EvidenceToProto(hypothesis.evidence);
    explanation->set_reason(ReasonFor(model, comparison, hypothesis, seed));
  }
  std::stable_sort(diagnosis->mutable_ranked()->begin(), diagnosis->mutable_ranked()->end(),
                   [](const v1::Explanation& a, const v1::Explanation& b) {
                     return a.probability() > b.probability();
                   });
  for (const Effect* effect : comparison.same_class) {
    diagnosis->add_same_class(Text(effect->description().id));
  }
  AddRemainder(comparison, diagnosis);
}

void AddUnfinished(const SetModel& model, const ModelComparison& comparison,
                   v1::Diagnosis* diagnosis) {
  constexpr size_t kScreenedOnly = 10;
  constexpr double kLeastGain = 1.5;  // [nats] as worth a fit
  for (const Hypothesis& hypothesis : comparison.ranked) {
    v1::Explanation* explanation = diagnosis->add_ranked();
    explanation->set_effect(NameOf(hypothesis, comparison));
    explanation->set_stage(StageOf(hypothesis, comparison));
    explanation->set_probability(hypothesis.probability);
    explanation->set_log_evidence_gain(hypothesis.log_evidence);
    *explanation->mutable_evidence() = EvidenceToProto(hypothesis.evidence);
    explanation->set_reason("fitted, not yet held to recordings that were not fitted");
    if (IsFreeForm(hypothesis)) continue;
    for (size_t i : Leading(hypothesis, comparison)) {
      *explanation->add_effects() = DescribeEffect(model, hypothesis, i);
    }
  }
  const auto fitted = [&](const Effect* effect) {
    return std::any_of(comparison.ranked.begin(), comparison.ranked.end(), [&](const auto& c) {
      return std::any_of(c.effects.begin(), c.effects.end(),
                         [&](const ActiveEffect& active) { return active.effect == effect; });
    });
  };
  const auto gain = [](const ScreenedEffect* s) { return std::max(s->gain, s->linear_gain); };
  std::vector<const ScreenedEffect*> only_screened;
  for (const ScreenedEffect& screened : comparison.screened) {
    const Effect* effect = screened.strongest.effect;
    if (!IsFreeForm(*effect) && gain(&screened) > kLeastGain && !fitted(effect)) {
      only_screened.push_back(&screened);
    }
  }
  std::stable_sort(only_screened.begin(), only_screened.end(),
                   [&](const auto* a, const auto* b) { return gain(a) > gain(b); });
  if (only_screened.size() > kScreenedOnly) only_screened.resize(kScreenedOnly);
  for (const ScreenedEffect* screened : only_screened) {
    const EffectDescription& description = screened->strongest.effect->description();
    v1::Explanation* explanation = diagnosis->add_ranked();
    explanation->set_effect(Text(description.id));
    explanation->set_stage(Text(StageName(description.stage)));
    explanation->set_log_evidence_gain(gain(screened));
    explanation->set_reason("looked at by itself, not fitted together with the known parameters");
  }
}

void AddStages(const ModelComparison& comparison, v1::Diagnosis* diagnosis) {
  std::map<std::string, std::pair<double, double>> stages;  // gain, probability
  for (const ScreenedEffect& screened : comparison.screened) {
    double& gain = stages[Text(StageName(screened.strongest.effect->description().stage))].first;
    gain = std::max(gain, screened.gain);
  }
  for (const Hypothesis& hypothesis : comparison.ranked) {
    const std::string stage = StageOf(hypothesis, comparison);
    if (stage == "none") continue;
    auto& [gain, probability] = stages[stage];
    gain = std::max(gain, hypothesis.log_evidence);
    probability += hypothesis.probability;
  }
  for (const auto& [stage, evidence] : stages) {
    v1::StageEvidence* added = diagnosis->add_stages();
    added->set_stage(stage);
    added->set_log_evidence_gain(evidence.first);
    added->set_probability(evidence.second);
    for (const StageTransfer& transfer : comparison.transfer) {
      if (StageName(transfer.stage) != stage) continue;
      added->set_transfer_gain(transfer.gain);
      added->set_transfer_behind(transfer.behind);
      added->set_transfer_behind_standard_error(transfer.behind_standard_error);
    }
  }
  AddLocatedStages(comparison, diagnosis);
}

void AddPower(const ModelComparison& comparison, v1::Diagnosis* diagnosis) {
  for (const ScreenedEffect& screened : comparison.screened) {
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

}  // namespace sightline
