// SPDX-License-Identifier: Apache-2.0
#include "tests/report/diagnosis/sample_diagnosis.h"

#include <cmath>
#include <string>

namespace sightline {
namespace {

// Repeatable scatter without a generator: fractional parts of a rotation, about normal.
double Scatter(int i) {
  double sum = 0;
  for (int k = 1; k <= 12; ++k) sum += std::fmod(0.6180339887 * (i + 1) * k + 0.137 * k * k, 1.0);
  return sum - 6;
}

constexpr double kFNumbers[] = {1.4, 2, 2.8, 4, 5.6, 8, 11, 16};
constexpr int kRecordings = 44;

bool IsDark(int i) { return i % 11 == 0; }
bool IsHeldOut(int i) { return i % 5 == 4; }

v1::Recordings Set() {
  v1::Recordings set;
  set.set_set("set_003");
  for (int i = 0; i < kRecordings; ++i) {
    v1::Recording* recording = set.add_recordings();
    recording->set_file("images/" + std::to_string(1000 + i).substr(1) + ".png");
    recording->set_kind(IsDark(i) ? "dark" : "laser");
    recording->set_series(IsDark(i) ? "dark" : i % 3 == 0 ? "exposure_sweep" : "aperture");
    recording->set_exposure_time_s(2e-4 * (1 + i % 7) * (1 + i % 7));
    recording->set_f_number(kFNumbers[i % 8]);
    recording->set_camera_distance_m(0.2 + 0.05 * (i % 6));
    recording->set_focus_distance_m(0.366);
  }
  return set;
}

v1::FittedParameter Parameter(const std::string& name, double value, double error) {
  v1::FittedParameter parameter;
  parameter.set_name(name);
  parameter.set_value(value);
  parameter.set_standard_error(error);
  parameter.set_lower(value - 1.96 * error);
  parameter.set_upper(value + 1.96 * error);
  return parameter;
}

v1::FittedEffect VeilingGlare() {
  v1::FittedEffect effect;
  effect.set_effect("optics.veiling_glare");
  effect.set_stage("optics");
  *effect.add_parameters() = Parameter("glare_fraction", 0.0512, 0.0021);
  *effect.add_parameters() = Parameter("halo_radius_m", 2.12e-4, 1.4e-5);
  effect.add_regions("background");
  effect.add_regions("line_flanks");
  effect.add_depends_on("signal_level");
  return effect;
}

v1::Explanation MakeExplanation(const std::string& effect, const std::string& stage,
                                double probability, double gain, double held_out,
                                const std::string& reason) {
  v1::Explanation explanation;
  explanation.set_effect(effect);
  explanation.set_stage(stage);
  explanation.set_probability(probability);
  explanation.set_log_evidence_gain(gain);
  explanation.set_held_out_chi_squared_per_dof(held_out);
  explanation.set_reason(reason);
  return explanation;
}

void AddRanked(v1::Diagnosis* diagnosis) {
  v1::Explanation glare = MakeExplanation(
      "optics.veiling_glare", "optics", 0.912, 143.2, 1.04,
      "Light beside the line follows the laser's power and not the exposure alone; dark "
      "frames are as described.");
  *glare.add_effects() = VeilingGlare();
  *diagnosis->add_ranked() = glare;
  v1::Explanation scatter =
      MakeExplanation("surface.subsurface_scattering", "surface", 0.061, 140.5, 1.06,
                      "Fits nearly as well, but its width would have to follow the magnification.");
  v1::FittedEffect* effect = scatter.add_effects();
  effect->set_effect("surface.subsurface_scattering");
  effect->set_stage("surface");
  *effect->add_parameters() = Parameter("scattered_fraction", 0.049, 0.003);
  *effect->add_parameters() = Parameter("spread_m", 3.4e-3, 4e-4);
  *diagnosis->add_ranked() = scatter;
  v1::Explanation pair = MakeExplanation("illumination.ambient_light", "illumination", 0.014, 137.9,
                                         1.05, "Two effects where one does as well.");
  effect = pair.add_effects();
  effect->set_effect("illumination.ambient_light");
  *effect->add_parameters() = Parameter("ambient_radiance_w_m2_sr", 5.4e-3, 3e-4);
  v1::FittedParameter* open = effect->add_parameters();
  open->set_name("gradient_u_relative");
  effect = pair.add_effects();
  effect->set_effect("sensor.dark_current");
  *effect->add_parameters() = Parameter("dark_current_electrons_per_s", 12.3, 4.1);
  *diagnosis->add_ranked() = pair;
  *diagnosis->add_ranked() = MakeExplanation("unknown", "optics", 0.008, 121, 1.2,
                                             "A free term is not needed where a known one fits.");
  *diagnosis->add_ranked() =
      MakeExplanation("none", "none", 4e-7, 0, 3.12, "Held-out recordings reject it.");
}

void AddFit(v1::Diagnosis* diagnosis) {
  const struct {
    const char* name;
    double uncertainty, value;
  } deviations[] = {
      {"camera_distance_m", 2e-3, 1.1e-3},    {"focus_distance_relative", 0.015, -0.004},
      {"f_number_relative", 0.015, 0.021},    {"laser_distance_m", 3e-3, 2e-4},
      {"incidence_angle_deg", 0.3, -0.21},    {"power_relative", 0.02, 0.011},
      {"diffuse_albedo_relative", 0.1, 0.17}, {"dark_mean_electrons", 0.3, 0.24},
      {"line_position_common_px", 1.5, 2.46}};
  for (const bool model : {false, true}) {
    v1::ModelFit* fit = model ? diagnosis->mutable_model_fit() : diagnosis->mutable_null_fit();
    fit->set_degrees_of_freedom(8120);
    fit->set_chi_squared(model ? 8233 : 24511);
    fit->set_p_value(model ? 0.19 : 0);
    for (const auto& d : deviations) {
      v1::FittedDeviation* deviation = fit->add_deviations();
      deviation->set_name(d.name);
      deviation->set_standard_uncertainty(d.uncertainty);
      deviation->set_value(d.value * (model ? 1 : 1.3));
      deviation->set_standard_error(0.3 * d.uncertainty);
    }
    for (int i = 0; i < kRecordings; ++i) {
      v1::RecordingFit* recording = fit->add_recordings();
      recording->set_recording(i);
      recording->set_held_out(IsHeldOut(i));
      recording->set_degrees_of_freedom(180);
      const double excess = model || IsDark(i) ? 1 : 1.2 + 9 * std::exp(-0.5 * (i % 7));
      recording->set_chi_squared(180 * (excess + 0.1 * Scatter(i + (model ? 100 : 0))));
      if (!IsDark(i)) {
        recording->set_intensity_ratio(1 + (model ? 0.004 : 0.05) + 0.01 * Scatter(i));
      }
    }
  }
  v1::HeldOutImprovement* held_out = diagnosis->mutable_held_out_improvement();
  held_out->set_measure("chi^2 per degree of freedom");
  held_out->set_null(3.12);
  held_out->set_with_effect(1.04);
  for (int i = 0; i < kRecordings; ++i) {
    if (IsHeldOut(i)) held_out->add_recordings(i);
  }
  for (const char* name : {"texture", "temporal noise", "dark frames"}) {
    v1::ObservableFit* fit = held_out->add_observables();
    fit->set_observable(name);
    fit->set_degrees_of_freedom(420);
    fit->set_null_chi_squared(std::string(name) == "texture" ? 702 : 431);
    fit->set_model_chi_squared(424);
  }
}

void AddPictures(v1::Diagnosis* diagnosis) {
  for (const int recording : {13, 21, 34, 3}) {
    v1::ProfileComparison* profile = diagnosis->add_profiles();
    profile->set_recording(recording);
    profile->set_channel("mono");
    for (int row = 0; row < 256; row += std::abs(row - 128) < 30 ? 2 : 8) {
      const double x = row - 128.0;
      const double line = 800 * std::exp(-x * x / 90), halo = 28 * std::exp(-std::abs(x) / 40);
      const double sigma = 0.3 + 0.02 * line;
      profile->add_row_px(row);
      profile->add_null_dn(4.4 + 1.02 * line);
      profile->add_model_dn(4.4 + line + halo);
      profile->add_observed_dn(4.4 + line + halo + sigma * Scatter(row + recording));
      profile->add_standard_deviation_dn(sigma);
    }
    v1::RegionMap* map = diagnosis->add_region_maps();
    map->set_recording(recording);
    map->set_rows(32);
    map->set_columns(12);
    for (int i = 0; i <= 32; ++i) map->add_row_edges_px(8 * i);
    for (int i = 0; i <= 12; ++i) map->add_column_edges_px(32 * i);
    for (int row = 0; row < 32; ++row) {
      for (int column = 0; column < 12; ++column) {
        const double x = row - 15.5, noise = Scatter(12 * row + column + recording);
        const double halo = 14 * std::exp(-std::abs(x) / 5) - 20 * std::exp(-x * x / 2);
        map->add_null_z(static_cast<float>(halo + noise));
        map->add_model_z(static_cast<float>(noise));
      }
    }
  }
}

}  // namespace

v1::Diagnosis SampleDiagnosis() {
  v1::Diagnosis diagnosis;
  diagnosis.set_set("set_003");
  diagnosis.set_verdict("effect");
  diagnosis.set_finding(
      "About 5 % of the light lies in a halo around the line: veiling glare of the lens.");
  diagnosis.set_seed(1);
  AddRanked(&diagnosis);
  diagnosis.add_same_class("optics.lens_reflection");
  v1::NextRecording* next = diagnosis.add_next_recordings();
  next->set_description("f/8, 20 ms, 0.20 m: a halo of the lens keeps its size on the sensor");
  next->set_expected_gain_bits(3.42);
  next->add_tells_apart("optics.veiling_glare");
  next->add_tells_apart("surface.subsurface_scattering");
  next->mutable_recording()->set_f_number(8);
  next->mutable_recording()->set_exposure_time_s(0.02);
  next->mutable_recording()->set_camera_distance_m(0.2);
  AddFit(&diagnosis);
  const struct {
    const char* stage;
    double gain, probability;
  } stages[] = {{"optics", 139.1, 0.93}, {"surface", 133.4, 0.05}, {"illumination", 96, 0.02},
                {"sensor", 41, 0.0001},  {"geometry", 12, 0},      {"time", 0.3, 0}};
  for (const auto& s : stages) {
    v1::StageEvidence* stage = diagnosis.add_stages();
    stage->set_stage(s.stage);
    stage->set_log_evidence_gain(s.gain);
    stage->set_probability(s.probability);
  }
  v1::SetupLaw* law = diagnosis.add_laws();
  law->set_quantity("exposure_time_s");
  law->set_law(
      "proportional to exposure_time_s^1 f_number^-2 (0.031 at exposure_time_s 0.0051, f_number "
      "8)");
  law->set_exponent(0.98);
  law->set_exponent_standard_error(0.04);
  law->set_explained(0.87);
  const struct {
    const char *effect, *parameter;
    double strength;
  } powers[] = {{"optics.veiling_glare", "glare_fraction", 0.004},
                {"illumination.ambient_light", "ambient_radiance_w_m2_sr", 4.1e-4},
                {"sensor.dark_current", "dark_current_electrons_per_s", 3.3},
                {"optics.coma", "w131_waves", 0.41},
                {"geometry.camera_roll", "roll_deg", 0.021},
                {"illumination.wavelength_error", "wavelength_shift_m", 1.1e-8}};
  for (const auto& p : powers) {
    v1::DetectableStrength* power = diagnosis.add_power();
    power->set_effect(p.effect);
    power->set_parameter(p.parameter);
    power->set_strength(p.strength);
  }
  diagnosis.mutable_power(0)->set_unit_note("at the halo radius found");
  AddPictures(&diagnosis);
  v1::FreeFormTerm* term = diagnosis.mutable_free_form();
  term->set_stage("optics");
  term->set_term("point_spread");
  term->set_abscissa("distance_from_line_m");
  term->set_ordinate("relative_irradiance");
  for (int i = 0; i < 20; ++i) {
    term->add_abscissa_values(2e-5 * i);
    term->add_values(0.05 * std::exp(-0.1 * i));
    term->add_standard_errors(0.002);
  }
  term->set_law("proportional to exposure_time_s");
  *diagnosis.mutable_calibrated() = Set();
  v1::Effect* glare = diagnosis.add_calibrated_effects();
  glare->set_effect("optics.veiling_glare");
  (*glare->mutable_parameters())["glare_fraction"] = 0.0512;
  (*glare->mutable_parameters())["halo_radius_m"] = 2.12e-4;
  diagnosis.add_warnings("Recording 12 holds even numbers only: were its values scaled?");
  return diagnosis;
}

v1::Verification SampleVerification() {
  v1::Verification verification;
  verification.set_set("set_003");
  verification.set_seed(1);
  for (int i = 0; i < 16; ++i) {
    v1::RecordingVerification* recording = verification.add_recordings();
    recording->set_recording(i);
    recording->set_file("images/" + std::to_string(1000 + i).substr(1) + ".png");
    recording->set_camera_distance_m(0.2 + 0.1 * (i % 4));
    recording->set_focus_distance_m(0.25 + 0.05 * (i % 3));
    recording->set_f_number(kFNumbers[i % 8]);
    recording->set_exposure_time_s(1e-3 * (1 + i % 5));
    recording->set_normalised_exposure(recording->exposure_time_s() * 484 /
                                       (recording->f_number() * recording->f_number()));
    int k = 0;
    for (const char* name : {"red", "green", "blue"}) {
      v1::ChannelVerification* channel = recording->add_channels();
      channel->set_channel(name);
      channel->set_e_i(0.05 + 0.03 * k + 0.02 * Scatter(i + 31 * k));
      channel->set_recorded_u_px(0.2 + 0.05 * (i % 8) + 0.05 * k);
      channel->set_simulated_u_px(0.19 + 0.048 * (i % 8) + 0.05 * k);
      channel->set_recorded_u_h_m(2e-5 * channel->recorded_u_px());
      channel->set_simulated_u_h_m(2e-5 * channel->simulated_u_px());
      channel->set_e_u(1 - channel->simulated_u_px() / channel->recorded_u_px());
      channel->set_recorded_found_fraction(i == 5 ? 0.87 : 1);
      channel->set_simulated_found_fraction(1);
      for (int row = k == 2; row < 128; row += 2) {
        const double line = (600 - 180 * k) * std::exp(-(row - 64.0) * (row - 64.0) / 120);
        channel->add_row_px(row);
        channel->add_recorded_dn(5 + line * (1 + 0.02 * Scatter(row + i)));
        channel->add_simulated_dn(5 + 0.94 * line);
      }
      ++k;
    }
  }
  const char* channels[] = {"red", "green", "blue"};
  for (int k = 0; k < 3; ++k) {
    v1::ChannelSummary* summary = verification.add_summary();
    summary->set_channel(channels[k]);
    summary->set_mean_e_i(0.05 + 0.03 * k);
    summary->set_largest_e_i(0.11 + 0.03 * k);
    summary->set_mean_e_u(0.041);
    summary->set_largest_e_u(-0.12);
    summary->set_deviation_e_i(0.021);
    summary->set_deviation_e_u(0.034);
    summary->set_recordings_e_i(16);
    summary->set_recordings_e_u(14);
  }
  verification.add_warnings("Two recordings are saturated; they are left out of the means.");
  return verification;
}

}  // namespace sightline
