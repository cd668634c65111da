// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/answer/transfer_messages.h"

#include <cstddef>
#include <optional>

#include "core/statistics/square.h"

namespace sightline {
namespace {

// `reference`: the prediction of the linear model, to which the gain of the log score refers.
v1::SensorFit FitMessage(const TransferFit& fit,
                         const std::optional<TransferPrediction>& prediction,
                         const std::optional<TransferPrediction>& reference) {
  v1::SensorFit message;
  message.set_chi_squared(fit.chi_squared);
  message.set_degrees_of_freedom(fit.degrees_of_freedom);
  if (prediction && reference) {
    message.set_held_out_chi_squared(prediction->chi_squared);
    message.set_held_out_numbers(prediction->numbers);
    message.set_held_out_log_score_gain(prediction->log_score - reference->log_score);
  }
  for (const TransferParameter& p : fit.parameters) {
    v1::SensorParameter* parameter = message.add_parameters();
    parameter->set_name(p.name);
    parameter->set_unit(p.unit);
    parameter->set_value(p.value);
    parameter->set_standard_error(p.standard_error);
  }
  return message;
}

v1::PhotonTransferPoint* AddPoint(const FlatFieldStatistics& step, v1::SensorDiagnosis* answer) {
  v1::PhotonTransferPoint* message = answer->add_photon_transfer();
  message->set_exposure_time_s(step.exposure_time_s);
  if (step.photons) message->set_photons(*step.photons);
  return message;
}

// Points without the numbers of the dark: black level and dark noise.
void AddPoints(const TransferFit& linear, const TransferFit& model, const FlatFieldSteps& steps,
               const Saturation& saturation, v1::SensorDiagnosis* answer) {
  const double black_dn = model.Value("black_level_dn");
  const double dark_variance_dn2 =
      Square(model.Value("gain_dn_per_electron")) * model.Value("dark_noise_variance_electrons2");
  for (size_t i = 0; i < model.points.size(); ++i) {
    const TransferPoint &point = model.points[i], &linear_point = linear.points[i];
    const FlatFieldStatistics& step = steps.all[point.step];
    if (step.dark) continue;
    v1::PhotonTransferPoint* message = AddPoint(step, answer);
    message->set_mean_dn(point.mean_dn - black_dn);
    message->set_mean_standard_error_dn(point.mean_standard_error_dn);
    message->set_variance_dn2(point.variance_dn2 - dark_variance_dn2);
    message->set_variance_standard_error_dn2(point.variance_standard_error_dn2);
    message->set_model_mean_dn(point.expected_mean_dn - black_dn);
    message->set_model_variance_dn2(point.expected_variance_dn2 - dark_variance_dn2);
    message->set_linear_mean_dn(linear_point.expected_mean_dn - black_dn);
    message->set_linear_variance_dn2(linear_point.expected_variance_dn2 - dark_variance_dn2);
  }
  for (const FlatFieldStatistics* step : steps.bright) {
    if (IsBelowSaturation(*step, steps.DarkMeanDn(step->exposure_time_s), saturation.signal_dn)) {
      continue;
    }
    v1::PhotonTransferPoint* message = AddPoint(*step, answer);
    message->set_mean_dn(step->MeanDn() - black_dn);
    message->set_variance_dn2(step->pair.temporal_variance_dn2 - dark_variance_dn2);
    message->set_saturated(true);
  }
}

}  // namespace

void AddTransferMessages(const TransferAnalysis& analysis, const FlatFieldSteps& steps,
                         const Saturation& saturation, v1::SensorDiagnosis* answer) {
  *answer->mutable_linear_fit() =
      FitMessage(*analysis.linear, analysis.linear_prediction, analysis.linear_prediction);
  *answer->mutable_model_fit() =
      FitMessage(*analysis.model, analysis.model_prediction, analysis.linear_prediction);
  AddPoints(*analysis.linear, *analysis.model, steps, saturation, answer);
}

}  // namespace sightline
