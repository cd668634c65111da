// SPDX-License-Identifier: Apache-2.0
#include "tests/report/recordings/sample_sensor.h"

#include <cmath>
#include <string>

namespace sightline {
namespace {

void AddParameter(const char* name, const char* unit, double value, double standard_error,
                  google::protobuf::RepeatedPtrField<v1::SensorParameter>* parameters) {
  v1::SensorParameter* parameter = parameters->Add();
  parameter->set_name(name);
  parameter->set_unit(unit);
  parameter->set_value(value);
  parameter->set_standard_error(standard_error);
}

v1::SensorDeparture* AddDeparture(const char* effect, const char* stage, const char* description,
                                  bool found, bool testable, double p_value,
                                  v1::SensorDiagnosis* diagnosis) {
  v1::SensorDeparture* departure = diagnosis->add_departures();
  departure->set_effect(effect);
  departure->set_stage(stage);
  departure->set_description(description);
  departure->set_found(found);
  departure->set_testable(testable);
  departure->set_p_value(p_value);
  if (testable) departure->set_probability(p_value < 1e-3 ? 0.973 : 0.04);
  return departure;
}

void AddQuantity(const char* name, const char* unit, double value, double half, const char* clause,
                 const char* note, v1::SensorDiagnosis* diagnosis) {
  v1::SensorQuantity* quantity = diagnosis->add_quantities();
  quantity->set_name(name);
  quantity->set_unit(unit);
  quantity->set_value(value);
  quantity->set_lower(value - half);
  quantity->set_upper(value + half);
  quantity->set_emva_value(1.01 * value);
  quantity->set_emva_lower(1.01 * value - 2 * half);
  quantity->set_emva_upper(1.01 * value + 2 * half);
  quantity->set_clause(clause);
  quantity->set_note(note);
}

// Light that the electronics compress by up to 2 %, with scatter that looks like noise.
void AddPhotonTransfer(v1::SensorDiagnosis* diagnosis) {
  constexpr int kSteps = 40;
  constexpr double kGain = 0.125, kQuantumEfficiency = 0.55, kFull_dn = 3900;
  for (int i = 0; i < kSteps; ++i) {
    v1::PhotonTransferPoint* point = diagnosis->add_photon_transfer();
    const double photons = 120 + 1600.0 * i;
    const double linear = kGain * kQuantumEfficiency * photons;
    const double model = linear * (1 - 0.02 * linear / kFull_dn);
    const double scatter = std::sin(7.3 * i);
    point->set_exposure_time_s(1e-5 * (4 + 30 * i));
    point->set_photons(photons);
    point->set_saturated(linear > kFull_dn);
    point->set_linear_mean_dn(0.99 * linear);
    point->set_model_mean_dn(model);
    point->set_linear_variance_dn2(kGain * linear);
    point->set_model_variance_dn2(kGain * model * (1 - 0.04 * linear / kFull_dn));
    point->set_mean_standard_error_dn(0.02 + 4e-4 * model);
    point->set_variance_standard_error_dn2(0.005 * point->model_variance_dn2());
    point->set_mean_dn(model + scatter * point->mean_standard_error_dn());
    point->set_variance_dn2(point->model_variance_dn2() +
                            std::cos(3.1 * i) * point->variance_standard_error_dn2());
    if (point->saturated()) {
      point->set_mean_dn(kFull_dn + 10);
      point->set_variance_dn2(3);
    }
  }
}

}  // namespace

v1::SensorDiagnosis SampleSensorDiagnosis() {
  v1::SensorDiagnosis diagnosis;
  diagnosis.set_set("bench camera");
  diagnosis.set_verdict("effect");
  diagnosis.set_finding("The camera answers with up to 2 % less than in proportion to the light.");
  diagnosis.mutable_camera()->set_name("bench camera");
  diagnosis.mutable_camera()->set_gain_dn_per_electron(0.125);
  AddQuantity("gain_dn_per_electron", "DN/e-", 0.1253, 0.0004, "6.6", "", &diagnosis);
  AddQuantity("quantum_efficiency", "", 0.551, 0.003, "6.6", "Photons are those of the data file.",
              &diagnosis);
  AddQuantity("prnu_relative", "1", 0.0121, 0.0002, "8.4", "", &diagnosis);
  AddQuantity("dark_noise_electrons", "e-", 13.2, 0.3, "6.6", "", &diagnosis);
  v1::SensorQuantity* current = diagnosis.add_quantities();
  current->set_name("dark_current_electrons_per_s");
  current->set_unit("e-/s");
  current->set_clause("7.1");
  current->set_note("All dark steps have one exposure time.");

  v1::SensorDeparture* found = AddDeparture(
      "response_nonlinearity", "readout", "The signal falls short of proportion by 2 % at the top.",
      true, true, 1e-30, &diagnosis);
  AddParameter("second_order_relative", "", -0.0201, 0.0007, found->mutable_parameters());
  AddParameter("third_order_relative", "", 0.0012, 0.0009, found->mutable_parameters());
  found = AddDeparture("row_noise", "readout", "Rows move together from image to image.", true,
                       true, 2e-4, &diagnosis);
  AddParameter("row_noise_electrons", "e-", 1.34, 0.08, found->mutable_parameters());
  AddDeparture("light_drift", "time", "The light kept to 0.1 %.", false, true, 0.6, &diagnosis);
  AddDeparture("dark_current", "sensor", "Record dark images at two exposure times or more.", false,
               false, 1, &diagnosis);

  v1::SensorFit* linear = diagnosis.mutable_linear_fit();
  linear->set_chi_squared(4210);
  linear->set_degrees_of_freedom(72);
  linear->set_held_out_chi_squared(4400);
  linear->set_held_out_numbers(76);
  linear->set_held_out_log_score_gain(0);
  AddParameter("gain_dn_per_electron", "DN/e-", 0.1239, 0.0002, linear->mutable_parameters());
  v1::SensorFit* model = diagnosis.mutable_model_fit();
  model->set_chi_squared(70.2);
  model->set_degrees_of_freedom(70);
  model->set_held_out_chi_squared(80);
  model->set_held_out_numbers(76);
  model->set_held_out_log_score_gain(2040);
  AddParameter("gain_dn_per_electron", "DN/e-", 0.1253, 0.0002, model->mutable_parameters());
  AddPhotonTransfer(&diagnosis);

  v1::SensorCurve* curve = diagnosis.add_curves();
  curve->set_title("Gain of rows");
  curve->set_abscissa("row [px]");
  curve->set_ordinate("mean over the row [DN]");
  for (int row = 0; row < 480; ++row) {
    curve->add_abscissa_values(row);
    curve->add_values(2000 + 15 * std::sin(0.01 * row) + 2 * std::sin(1.7 * row));
  }
  curve = diagnosis.add_curves();
  curve->set_title("Signal lost against the light");
  curve->set_abscissa("signal [DN]");
  curve->set_ordinate("part lost [%]");
  for (int i = 1; i < 12; ++i) {
    curve->add_abscissa_values(330 * i);
    curve->add_values(0.18 * i);
    curve->add_standard_errors(0.05);
  }
  diagnosis.add_warnings("Step 17 has two images that differ by more than noise.");
  return diagnosis;
}

}  // namespace sightline
