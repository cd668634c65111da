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
#include "render_worker/diagnosis/finding/effect_signature.h"
#include "render_worker/diagnosis/fit/fit_quality.h"
#include "render_worker/diagnosis/fit/model_error.h"
#include "render_worker/diagnosis/free_form/free_form.h"
#include "render_worker/diagnosis/random_effect/recording_scatter.h"

namespace sightline {

namespace {

// Of a colour sensor's efficiency for other light than the laser's, which its description does not
// give: the radiance of that light is known as badly.
constexpr double kEfficiencyError = 0.4;

std::string Text(std::string_view text) { return std::string(text); }

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

}  // namespace

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

void AddUnfinished(const SetModel& model, const Competition& competition,
                   v1::Diagnosis* diagnosis) {
  constexpr size_t kScreenedOnly = 10;
  constexpr double kLeastGain = 1.5;  // [nats] as worth a fit
  for (const Candidate& candidate : competition.ranked) {
    v1::Explanation* explanation = diagnosis->add_ranked();
    explanation->set_effect(NameOf(candidate, competition));
    explanation->set_stage("none");
    if (!candidate.effects.empty()) {
      const ActiveEffect& first = candidate.effects[Leading(candidate, competition).front()];
      explanation->set_stage(Text(StageName(first.effect->description().stage)));
    }
    explanation->set_probability(candidate.probability);
    explanation->set_log_evidence_gain(candidate.log_evidence);
    explanation->set_reason("fitted, not yet held to recordings that were not fitted");
    if (IsFreeForm(candidate)) continue;
    for (size_t i : Leading(candidate, competition)) {
      *explanation->add_effects() = DescribeEffect(model, candidate, i);
    }
  }
  const auto fitted = [&](const Effect* effect) {
    return std::any_of(competition.ranked.begin(), competition.ranked.end(), [&](const auto& c) {
      return std::any_of(c.effects.begin(), c.effects.end(),
                         [&](const ActiveEffect& active) { return active.effect == effect; });
    });
  };
  const auto gain = [](const ScreenedEffect* s) { return std::max(s->gain, s->linear_gain); };
  std::vector<const ScreenedEffect*> only_screened;
  for (const ScreenedEffect& screened : competition.screened) {
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

}  // namespace sightline
