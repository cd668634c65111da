// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "render_worker/effects/effect.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

struct VocabularyEntry {
  const char* id;
  std::vector<std::string> parameters;
};

// Section 5 of the recordings format, in its order.
const std::vector<VocabularyEntry>& Vocabulary() {
  static const std::vector<VocabularyEntry> entries = {
      {"illumination.ambient_light",
       {"ambient_radiance_w_m2_sr", "gradient_u_relative", "gradient_v_relative", "green_to_red",
        "blue_to_red"}},
      {"illumination.power_error", {"amplitude_factor"}},
      {"illumination.power_drift", {"drift_relative", "drift_time_s"}},
      {"illumination.power_noise", {"power_noise_relative"}},
      {"illumination.beam_quality", {"m2"}},
      {"illumination.beam_focus", {"beam_focus_shift_m"}},
      {"illumination.beam_shape", {"shape_exponent"}},
      {"illumination.line_nonuniformity",
       {"slope_relative", "ripple_relative", "ripple_period_deg", "ripple_phase_deg"}},
      {"illumination.line_bow", {"bow_m"}},
      {"illumination.ghost_line", {"ghost_relative", "ghost_offset_m"}},
      {"illumination.partial_coherence", {"modes"}},
      {"illumination.wavelength_error", {"wavelength_shift_m"}},
      {"surface.albedo_error", {"amplitude_factor"}},
      {"surface.brdf_error", {"alpha_factor"}},
      {"surface.subsurface_scattering", {"scattered_fraction", "spread_m"}},
      {"surface.depolarisation", {"degree_of_polarisation"}},
      {"surface.albedo_texture", {"texture_rms_relative", "texture_length_m"}},
      {"surface.tilted_plate", {"tilt_deg"}},
      {"surface.curved_plate", {"curvature_per_m"}},
      {"surface.fluorescence", {"fluorescence_relative"}},
      {"optics.f_number_error", {"f_number_factor"}},
      {"optics.transmission_error", {"amplitude_factor"}},
      {"optics.focus_error", {"focus_distance_factor"}},
      {"optics.spherical_aberration", {"w040_waves"}},
      {"optics.coma", {"w131_waves"}},
      {"optics.astigmatism", {"w222_waves"}},
      {"optics.field_curvature", {"w220_waves"}},
      {"optics.veiling_glare", {"glare_fraction", "halo_radius_m"}},
      {"optics.lens_reflection", {"reflection_relative", "displacement_v_m", "displacement_u_m"}},
      {"optics.radial_distortion", {"k1_relative"}},
      {"optics.mechanical_vignetting", {"rim_radius_m", "rim_shift_per_tangent_m"}},
      {"optics.polygon_aperture", {"blades"}},
      {"optics.cover_glass_etalon",
       {"fringe_visibility", "fringe_period_px", "fringe_direction_deg", "fringe_phase_deg"}},
      {"optics.dust", {"spots"}},
      {"geometry.camera_distance_error", {"camera_distance_shift_m"}},
      {"geometry.laser_distance_error", {"laser_distance_shift_m"}},
      {"geometry.incidence_angle_error", {"incidence_shift_deg"}},
      {"geometry.camera_roll", {"roll_deg"}},
      {"geometry.laser_roll", {"roll_deg"}},
      {"geometry.sensor_tilt", {"sensor_tilt_deg"}},
      {"sensor.response_nonlinearity", {"nonlinearity"}},
      {"sensor.dark_current", {"dark_current_electrons_per_s"}},
      {"sensor.black_level_error", {"black_level_shift_electrons"}},
      {"sensor.prnu", {"prnu_relative"}},
      {"sensor.dsnu_column_pattern", {"column_offset_electrons", "pixel_offset_electrons"}},
      {"sensor.hot_pixels", {"hot_fraction"}},
      {"sensor.crosstalk", {"crosstalk_fraction"}},
      {"sensor.brighter_fatter", {"boundary_shift_per_electron"}},
      {"sensor.blooming", {"blooming_fraction", "threshold_electrons", "reach_px"}},
      {"sensor.smear", {"smear_relative"}},
      {"sensor.lower_full_well", {"full_well_electrons"}},
      {"sensor.gain_error", {"gain_factor"}},
      {"sensor.column_gain", {"gain_difference_relative"}},
      {"sensor.qe_error", {"qe_factor", "qe_factor_green", "qe_factor_blue"}},
      {"sensor.colour_response_error", {"qe_factor_green", "qe_factor_blue"}},
      {"sensor.micro_lens_vignetting", {"acceptance_f_number", "roll_off_order"}},
      {"sensor.read_noise_excess", {"noise_factor"}},
      {"sensor.row_noise", {"row_noise_electrons"}},
      {"sensor.adc_missing_bits", {"missing_bits"}},
      {"sensor.adc_inl", {"inl_amplitude_dn", "inl_cycles"}},
      {"sensor.image_lag", {"lag_fraction"}},
      {"sensor.rolling_shutter", {"row_time_s"}},
      {"time.vibration_blur", {"vibration_amplitude_px", "vibration_frequency_hz"}},
      {"time.plate_motion", {"plate_speed_m_s"}},
      {"time.exposure_offset", {"exposure_offset_s"}},
      {"time.exposure_jitter", {"exposure_jitter_s"}},
      {"time.ambient_flicker",
       {"ambient_radiance_w_m2_sr", "flicker_depth", "flicker_frequency_hz"}},
      {"time.temperature_drift", {"dark_drift_electrons_per_s"}}};
  return entries;
}

TEST(Registry, HoldsTheWholeVocabularyOnce) {
  std::multiset<std::string> ids;
  for (const Effect* effect : AllEffects()) ids.insert(std::string(effect->description().id));
  for (const VocabularyEntry& entry : Vocabulary()) {
    EXPECT_EQ(ids.count(entry.id), 1) << entry.id;
    const Effect* effect = FindEffect(entry.id);
    ASSERT_NE(effect, nullptr) << entry.id;
    std::vector<std::string> names;
    for (const EffectParameter& parameter : effect->description().parameters) {
      names.emplace_back(parameter.name);
    }
    EXPECT_EQ(names, entry.parameters) << entry.id;
  }
  // Beyond the vocabulary: what the lens model has besides.
  EXPECT_EQ(ids.size(), Vocabulary().size() + 2);
  EXPECT_EQ(ids.count("optics.tangential_distortion"), 1);
  EXPECT_EQ(ids.count("optics.natural_vignetting"), 1);
}

TEST(Registry, DescriptionsAreSane) {
  const std::vector<std::string> stages = {"illumination", "surface", "optics",
                                           "geometry",     "sensor",  "time"};
  for (const Effect* effect : AllEffects()) {
    const EffectDescription& description = effect->description();
    const std::string id(description.id);
    EXPECT_EQ(id.substr(0, id.find('.')), stages[static_cast<size_t>(description.stage)]) << id;
    EXPECT_FALSE(description.summary.empty()) << id;
    EXPECT_FALSE(description.reference.empty()) << id;
    EXPECT_FALSE(description.parameters.empty()) << id;
    for (const EffectParameter& parameter : description.parameters) {
      EXPECT_LE(parameter.lower, parameter.null_value) << id << " " << parameter.name;
      EXPECT_LE(parameter.null_value, parameter.upper) << id << " " << parameter.name;
      EXPECT_LT(parameter.lower, parameter.upper) << id << " " << parameter.name;
      EXPECT_GT(parameter.prior_scale, 0) << id << " " << parameter.name;
      EXPECT_LE(parameter.prior_scale, parameter.upper - parameter.lower)
          << id << " " << parameter.name;
    }
  }
}

// The diagnosis and the calibration of inspections rely on these properties.
TEST(Registry, DescriptionsAgreeWithThemselves) {
  for (const Effect* effect : AllEffects()) {
    const EffectDescription& description = effect->description();
    const std::string id(description.id);
    // Findings quote the signature.
    EXPECT_NE(description.plates_can_show_it, description.signature.regions.empty()) << id;
    if (description.random_law != RandomLaw::kNone) {
      EXPECT_TRUE(description.kind == EffectKind::kRandomPerRecording ||
                  description.kind == EffectKind::kRandomPerPlace)
          << id;
    }
    EXPECT_TRUE(description.IsRandom() || description.ChangesExpectation()) << id;
    EXPECT_FALSE(description.VariesOverSensor() && description.ChangesExpectation()) << id;
    if (description.column_transport == ColumnTransport::kOverflow) {
      EXPECT_GE(description.parameters.size(), 2u) << id;
    }
    for (const EffectParameter& parameter : description.parameters) {
      for (const double value : parameter.discrete_values) {
        EXPECT_GE(value, parameter.lower) << id;
        EXPECT_LE(value, parameter.upper) << id;
        EXPECT_NE(value, parameter.null_value) << id;
        EXPECT_EQ(value, std::round(value)) << id;
      }
    }
    for (const InspectionField& field : description.inspection_fields) {
      ASSERT_GE(field.parameter, 0) << id;
      ASSERT_LT(static_cast<size_t>(field.parameter), description.parameters.size()) << id;
      // At its null value a parameter changes no number of an inspection.
      const double null_value = description.parameters[field.parameter].null_value;
      EXPECT_EQ(null_value,
                field.operation == InspectionField::kFactor && !field.field.empty() ? 1 : 0)
          << id << " " << field.field;
    }
  }
}

TEST(Registry, OnlyLensEffectsOfNoPlateAreHiddenFromIt) {
  std::set<std::string> hidden;
  for (const Effect* effect : AllEffects()) {
    if (!effect->description().plates_can_show_it) hidden.emplace(effect->description().id);
  }
  EXPECT_EQ(hidden,
            (std::set<std::string>{"optics.natural_vignetting", "optics.tangential_distortion"}));
}

TEST(MakeActiveEffect, LeftOutParametersAreNull) {
  const auto active = MakeActiveEffect("optics.veiling_glare", {{"glare_fraction", 0.1}});
  ASSERT_TRUE(active.ok()) << active.status();
  EXPECT_EQ(active->effect, FindEffect("optics.veiling_glare"));
  EXPECT_EQ(active->parameters[0], 0.1);
  EXPECT_EQ(active->parameters[1], active->effect->description().parameters[1].null_value);
}

TEST(MakeActiveEffect, NamesWhatIsWrong) {
  const auto error = [](const char* id, const std::vector<NamedValue>& parameters) {
    const auto active = MakeActiveEffect(id, parameters);
    EXPECT_EQ(active.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(active.status().message());
  };
  EXPECT_THAT(error("optics.veilling_glare", {}),
              AllOf(HasSubstr("\"optics.veilling_glare\""), HasSubstr("\"optics.veiling_glare\"")));
  EXPECT_THAT(error("optics.veiling_glare", {{"halo_radius", 1e-4}}),
              HasSubstr("the nearest known name is \"halo_radius_m\""));
  EXPECT_THAT(error("optics.veiling_glare", {{"glare_fraction", 1.5}}),
              HasSubstr("glare_fraction is 1.5, must be in [0, 0.9]"));
  EXPECT_THAT(error("optics.veiling_glare", {{"glare_fraction", NAN}}),
              HasSubstr("must be in [0, 0.9]"));
  EXPECT_THAT(error("sensor.prnu", {{"prnu_relative", 0.1}, {"prnu_relative", 0.1}}),
              HasSubstr("given twice"));
}

TEST(OrderEffects, IsThatOfTheVocabularyAndRefusesRepeats) {
  std::vector<ActiveEffect> effects;
  for (size_t i = AllEffects().size(); i-- > 0;) effects.push_back({AllEffects()[i], {}});
  ASSERT_TRUE(OrderEffects(&effects).ok());
  ASSERT_EQ(effects.size(), AllEffects().size());
  for (size_t i = 0; i < effects.size(); ++i) EXPECT_EQ(effects[i].effect, AllEffects()[i]);
  effects.push_back({AllEffects()[0], {}});
  EXPECT_EQ(OrderEffects(&effects).code(), absl::StatusCode::kInvalidArgument);
}

// A diagnosis writes fitted discrepancy terms among the calibrated effects, for renderers to read.
TEST(Effects, DiscrepancyTermsAreFoundByIdAndActAfterTheVocabulary) {
  const auto term = MakeActiveEffect("unknown.response_law", {{"exponent", 0.1}});
  ASSERT_TRUE(term.ok()) << term.status();
  EXPECT_EQ(FindEffect("unknown.response_law"), nullptr);
  EXPECT_EQ(term->parameters, (std::vector<double>{0.1, 0, 0}));
  std::vector<ActiveEffect> effects = {*term, {FindEffect("sensor.dark_current"), {20}}};
  ASSERT_TRUE(OrderEffects(&effects).ok());
  ASSERT_EQ(effects.size(), 2);
  EXPECT_EQ(effects[1].effect, term->effect);
  effects.push_back(*term);
  EXPECT_EQ(OrderEffects(&effects).code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace sightline
