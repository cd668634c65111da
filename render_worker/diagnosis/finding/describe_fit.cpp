// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/finding/describe_fit.h"

#include <algorithm>
#include <numbers>
#include <string>
#include <string_view>
#include <vector>

#include "render_worker/diagnosis/fit/fit_quality.h"
#include "render_worker/sensor/expose.h"

namespace sightline {

namespace {

// Mean signal of a recording's profiles over what the fit expects; 0: no laser light.
double IntensityRatio(const SetModel& model, const FitResult& fit, int frame) {
  const Sensor& sensor = model.set().frames[frame].nominal.sensor;
  const double black_dn = DarkMeanDn(sensor);
  double observed = 0, expected = 0;
  for (int e = 0; e < model.blocks(); ++e) {
    if (model.StatisticOf(e).kind() != StatisticKind::kProfile) continue;
    for (int row = 0; row < static_cast<int>(fit.mean[e].size()); ++row) {
      if (model.FrameOfComponent(e, row) != frame) continue;
      observed += model.observed()[e][row] - black_dn;
      expected += fit.mean[e][row] - black_dn;
    }
  }
  return expected > 0 ? observed / expected : 0;
}

}  // namespace

v1::ModelFit DescribeFit(const SetModel& model, const FitResult& fit) {
  v1::ModelFit description;
  description.set_chi_squared(fit.chi_squared);
  description.set_degrees_of_freedom(fit.data_count);
  description.set_p_value(ChiSquaredPValue(fit.chi_squared, fit.data_count));
  SetupDeviation uncertainty = model.set().description.uncertainty;
  SetupDeviation deviations = fit.parameters.deviations;
  int column = 0;
  for (int i = 0; i < kDeviations; ++i) {
    const double stated = DeviationAt(uncertainty, i);
    if (stated <= 0) continue;
    const double scale =
        std::string_view(kDeviationNames[i]) == "incidence_angle_deg" ? 180 / std::numbers::pi : 1;
    v1::FittedDeviation* deviation = description.add_deviations();
    deviation->set_name(kDeviationNames[i]);
    deviation->set_standard_uncertainty(scale * stated);
    deviation->set_value(scale * DeviationAt(deviations, i));
    deviation->set_standard_error(scale * stated * std::sqrt(fit.covariance(column, column)));
    ++column;
  }
  std::vector<double> chi_squared(model.set().frames.size(), 0);
  std::vector<int> count(chi_squared.size(), 0);
  for (int e = 0; e < model.blocks(); ++e) {
    for (int row = 0; row < static_cast<int>(fit.residual[e].size()); ++row) {
      const int frame = model.FrameOfComponent(e, row);
      chi_squared[frame] += fit.residual[e][row] * fit.residual[e][row];
      ++count[frame];
    }
  }
  for (size_t f = 0; f < chi_squared.size(); ++f) {
    v1::RecordingFit* recording = description.add_recordings();
    recording->set_recording(static_cast<int>(f));
    recording->set_held_out(true);
    recording->set_chi_squared(chi_squared[f]);
    recording->set_degrees_of_freedom(count[f]);
    if (model.set().frames[f].plate_position_id < 0) continue;
    const double ratio = IntensityRatio(model, fit, static_cast<int>(f));
    if (ratio > 0) recording->set_intensity_ratio(ratio);
  }
  return description;
}

v1::HeldOutImprovement DescribeImprovement(const SetModel& model, const FitResult& null,
                                           const FitResult& best, uint64_t seed) {
  v1::HeldOutImprovement improvement;
  improvement.set_measure(
      "chi^2 per degree of freedom; every recording by a fit to three quarters of the others");
  for (size_t f = 0; f < model.set().frames.size(); ++f) {
    improvement.add_recordings(static_cast<int>(f));
  }
  const PredictedFit before = CrossValidate(model, null, seed);
  const PredictedFit after = CrossValidate(model, best, seed);
  if (before.degrees_of_freedom > 0) {
    improvement.set_null(before.chi_squared / before.degrees_of_freedom);
    improvement.set_with_effect(after.chi_squared / after.degrees_of_freedom);
  }
  std::vector<std::string> names;
  for (int e = 0; e < model.blocks(); ++e) {
    const std::string name(model.StatisticOf(e).name());
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  for (const std::string& name : names) {
    std::vector<bool> others, these;
    for (int e = 0; e < model.blocks(); ++e) {
      these.push_back(model.StatisticOf(e).name() == name);
      others.push_back(!these.back());
    }
    const PredictedFit null_fit = PredictBlocks(null, others, these);
    const PredictedFit best_fit = PredictBlocks(best, others, these);
    v1::ObservableFit* observable = improvement.add_observables();
    observable->set_observable(name);
    observable->set_null_chi_squared(null_fit.chi_squared);
    observable->set_model_chi_squared(best_fit.chi_squared);
    observable->set_degrees_of_freedom(null_fit.degrees_of_freedom);
  }
  return improvement;
}

v1::PredictiveCheck DescribeCheck(const PredictiveCheck& check, const PredictiveCheck& null) {
  v1::PredictiveCheck described;
  described.set_p_value(check.p_value);
  described.set_log_score_gain(check.log_score - null.log_score);
  for (const PredictedGroup& group : check.groups) {
    v1::PredictedGroup* added = described.add_groups();
    added->set_name(group.name);
    added->set_chi_squared(group.chi_squared);
    added->set_degrees_of_freedom(group.degrees_of_freedom);
    added->set_p_value(group.p_value);
  }
  return described;
}

}  // namespace sightline
