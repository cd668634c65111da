// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/answer/camera_values.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

#include "absl/strings/str_format.h"
#include "core/sensor/sensor.h"
#include "core/statistics/square.h"

namespace sightline {
namespace {

// Default for an unmeasured quantum efficiency, since a camera file must have one. A usual value of
// monochrome cameras in green light [1].
constexpr double kUnknownEfficiency = 0.5;
// Wavelength at which the camera file has it [m]: green, as most EMVA 1288 data sheets.
constexpr double kGreen_m = 550e-9;

using OptionalEstimate = std::optional<Estimate>;

OptionalEstimate FittedValue(const std::optional<TransferFit>& fit, const char* name) {
  if (!fit) return std::nullopt;
  const TransferParameter* parameter = fit->Find(name);
  if (!parameter) return std::nullopt;
  return Estimate{parameter->value, parameter->standard_error};
}

// Standard error by the first derivative.
OptionalEstimate SquareRoot(const OptionalEstimate& square) {
  if (!square || square->value <= 0) return std::nullopt;
  const double root = std::sqrt(square->value);
  return Estimate{root, square->standard_error / (2 * root)};
}

// The error of the gain is neglected.
Estimate InElectrons(const Estimate& dn, double gain) {
  return {dn.value / gain, dn.standard_error / gain};
}

// Fitted values; unset: the set does not determine them.
struct FittedCamera {
  OptionalEstimate gain, efficiency, dark_noise, black_level, dark_current, capacity;
  OptionalEstimate dsnu_electrons, prnu;
};

FittedCamera FittedCameraOf(const MeasuredCamera& measured) {
  const std::optional<TransferFit>& model = measured.transfer.model;
  FittedCamera camera;
  camera.gain = FittedValue(model, "gain_dn_per_electron");
  camera.efficiency = FittedValue(model, "quantum_efficiency");
  camera.dark_noise = SquareRoot(FittedValue(model, "dark_noise_variance_electrons2"));
  camera.black_level = FittedValue(model, "black_level_dn");
  camera.dark_current = FittedValue(model, "dark_current_electrons_per_s");
  const double signal_dn = measured.saturation.signal_dn;
  if (camera.gain && measured.saturation.reached) {
    camera.capacity =
        Estimate{signal_dn / camera.gain->value,
                 signal_dn / Square(camera.gain->value) * camera.gain->standard_error};
  }
  if (measured.patterns.dark && camera.gain) {
    camera.dsnu_electrons = InElectrons(measured.patterns.dark->Strength(), camera.gain->value);
  }
  if (measured.patterns.bright) camera.prnu = measured.patterns.bright->Strength();
  return camera;
}

struct CameraQuantity {
  std::string name, unit, clause;
  OptionalEstimate fitted, emva;
  std::string note = {};
};

void AddQuantity(const CameraQuantity& quantity, v1::SensorDiagnosis* answer) {
  v1::SensorQuantity* message = answer->add_quantities();
  message->set_name(quantity.name);
  message->set_unit(quantity.unit);
  message->set_clause(quantity.clause);
  message->set_note(quantity.note);
  if (quantity.fitted) {
    message->set_value(quantity.fitted->value);
    message->set_lower(quantity.fitted->Lower95());
    message->set_upper(quantity.fitted->Upper95());
  }
  if (quantity.emva) {
    message->set_emva_value(quantity.emva->value);
    message->set_emva_lower(quantity.emva->Lower95());
    message->set_emva_upper(quantity.emva->Upper95());
  }
}

// Gain, quantum efficiency, dark noise and the like, by both methods.
void AddTransferQuantities(const MeasuredCamera& measured, const FittedCamera& camera,
                           v1::SensorDiagnosis* answer) {
  const std::optional<PhotonTransfer>& emva = measured.standard.transfer;
  const auto by_standard = [&emva](Estimate PhotonTransfer::*member) -> OptionalEstimate {
    if (!emva) return std::nullopt;
    return (*emva).*member;
  };
  const std::optional<DarkCurrent>& emva_dark = measured.standard.dark_current;
  const bool saturated = measured.saturation.reached;
  AddQuantity({"gain_dn_per_electron", "DN/e-", "6.6", camera.gain,
               by_standard(&PhotonTransfer::gain_dn_per_electron), measured.transfer.undetermined},
              answer);
  AddQuantity({"quantum_efficiency", "", "6.6", camera.efficiency,
               camera.efficiency ? by_standard(&PhotonTransfer::quantum_efficiency) : std::nullopt,
               camera.efficiency ? "" : "the data file gives no photons"},
              answer);
  AddQuantity({"dark_noise_electrons", "e-", "6.6", camera.dark_noise,
               by_standard(&PhotonTransfer::dark_noise_electrons),
               emva && emva->dark_noise_is_upper_bound ? "quantisation hides it: upper bound" : ""},
              answer);
  AddQuantity({"black_level_dn", "DN", "7.1", camera.black_level, std::nullopt,
               "mean without light at exposure time 0"},
              answer);
  AddQuantity({"dark_current_electrons_per_s", "e-/s", "7.1", camera.dark_current,
               emva_dark ? std::optional(emva_dark->from_mean_electrons_per_s) : std::nullopt,
               camera.dark_current ? "" : "all exposure times are nearly the same"},
              answer);
  AddQuantity(
      {"saturation_capacity_electrons", "e-", "6.6", camera.capacity,
       saturated ? by_standard(&PhotonTransfer::saturation_capacity_electrons) : std::nullopt,
       saturated ? "by the largest variance" : "no step saturates"},
      answer);
}

// Quantities that only the standard defines.
void AddStandardQuantities(const PhotonTransfer& emva, v1::SensorDiagnosis* answer) {
  AddQuantity({"sensitivity_threshold_photons", "photons", "6.8", std::nullopt,
               emva.sensitivity_threshold_photons},
              answer);
  AddQuantity({"dynamic_range", "", "6.8", std::nullopt, Estimate{emva.dynamic_range, 0}}, answer);
  AddQuantity({"largest_snr", "", "6.8", std::nullopt, Estimate{emva.largest_snr, 0}}, answer);
  AddQuantity({"linearity_error_relative", "", "6.9", std::nullopt,
               Estimate{emva.linearity_error_relative, 0},
               absl::StrFormat("temporal noise alone gives %.2g", emva.linearity_noise_relative)},
              answer);
}

// The fitted and the standard's non-uniformity differ by the gain only.
void AddNonUniformity(const MeasuredCamera& measured, const FittedCamera& camera,
                      v1::SensorDiagnosis* answer) {
  const std::optional<PhotonTransfer>& emva = measured.standard.transfer;
  OptionalEstimate emva_dsnu;
  if (measured.patterns.bright && emva) {
    emva_dsnu = InElectrons(measured.patterns.dark->Strength(), emva->gain_dn_per_electron.value);
  }
  const char* note =
      "the smooth course and pixels more than six standard deviations out are taken off";
  AddQuantity({"dsnu_electrons", "e-", "8.2", camera.dsnu_electrons, emva_dsnu,
               camera.dsnu_electrons ? note : ""},
              answer);
  AddQuantity({"prnu_relative", "", "8.2", camera.prnu, camera.prnu, camera.prnu ? note : ""},
              answer);
}

// The camera file: fitted values, defaults for the others.
Sensor CameraFile(const MeasuredCamera& measured, const FittedCamera& camera) {
  Sensor sensor;
  sensor.name = measured.set.name();
  sensor.columns_px = measured.set.columns_px();
  sensor.rows_px = measured.set.rows_px();
  sensor.bit_depth_bit = measured.set.bit_depth_bit();
  if (camera.gain) sensor.gain_dn_per_electron = camera.gain->value;
  const double eta =
      camera.efficiency ? std::clamp(camera.efficiency->value, 0.0, 1.0) : kUnknownEfficiency;
  sensor.quantum_efficiency[0] = {{kGreen_m}, {eta}};
  if (camera.dark_noise) sensor.dark_noise_electrons = camera.dark_noise->value;
  sensor.black_level_dn =
      std::max(0.0, camera.black_level ? camera.black_level->value : measured.steps.DarkMeanDn(0));
  if (camera.dark_current) {
    sensor.dark_current_electrons_per_s = std::max(0.0, camera.dark_current->value);
  }
  if (camera.capacity) {
    sensor.saturation_capacity_electrons = camera.capacity->value;
  } else if (camera.gain) {
    sensor.saturation_capacity_electrons =
        (sensor.largest_dn() - sensor.black_level_dn) / camera.gain->value;
  }
  if (camera.dsnu_electrons) sensor.dsnu_electrons = camera.dsnu_electrons->value;
  if (camera.prnu) sensor.prnu_relative = camera.prnu->value;
  return sensor;
}

void AddCameraWarnings(const OptionalEstimate& efficiency, v1::SensorDiagnosis* answer) {
  if (efficiency && efficiency->value > 1) {
    answer->add_warnings(
        absl::StrFormat("the quantum efficiency comes out as %.3g, above 1: the photons of the "
                        "data file are too few",
                        efficiency->value));
  }
  answer->add_warnings("the pixel pitch is not measured; camera.json has the default of 5.3 um");
  if (!efficiency) {
    answer->add_warnings(absl::StrFormat(
        "the quantum efficiency is not measured; camera.json has %.2g", kUnknownEfficiency));
  }
}

void AddCurve(const char* title, const char* abscissa, const char* ordinate,
              const std::vector<double>& values, v1::SensorDiagnosis* answer) {
  v1::SensorCurve* curve = answer->add_curves();
  curve->set_title(title);
  curve->set_abscissa(abscissa);
  curve->set_ordinate(ordinate);
  for (size_t i = 0; i < values.size(); ++i) {
    curve->add_abscissa_values(static_cast<double>(i));
    curve->add_values(values[i]);
  }
}

void AddPatternCurves(const FixedPatterns& patterns, v1::SensorDiagnosis* answer) {
  if (patterns.dark) {
    AddCurve("Offsets of the columns", "column_px", "offset_dn", ColumnMeans(*patterns.dark),
             answer);
    AddCurve("Offsets of the rows", "row_px", "offset_dn", RowMeans(*patterns.dark), answer);
  }
  if (patterns.bright) {
    AddCurve("Sensitivity of the columns", "column_px", "deviation_relative",
             ColumnMeans(*patterns.bright), answer);
    AddCurve("Sensitivity of the rows", "row_px", "deviation_relative", RowMeans(*patterns.bright),
             answer);
  }
}

}  // namespace

void AddCameraValues(const MeasuredCamera& measured, v1::SensorDiagnosis* answer) {
  const FittedCamera camera = FittedCameraOf(measured);
  AddTransferQuantities(measured, camera, answer);
  if (measured.standard.transfer) AddStandardQuantities(*measured.standard.transfer, answer);
  AddNonUniformity(measured, camera, answer);
  *answer->mutable_camera() = SensorToProto(CameraFile(measured, camera));
  answer->mutable_camera()->set_source("measured from flat-field and dark frames");
  AddCameraWarnings(camera.efficiency, answer);
  AddPatternCurves(measured.patterns, answer);
}

}  // namespace sightline
