// SPDX-License-Identifier: Apache-2.0
#include "bench/concealed/effect_draw.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <map>
#include <string_view>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "bench/concealed/shape_range.h"

namespace sightline::bench {
namespace {

// Facts about effects that their descriptions do not state: which parameters merely shape, and what
// else is peculiar. All other parameters are strengths.
struct Recipe {
  std::vector<ShapeRange> shapes = {};
  bool geometric = false;
  bool whole_numbers = false;
};

Recipe RecipeOf(const Effect& effect) {
  if (const OutsideLaw* law = FindOutsideLaw(effect.description().id)) {
    return {.shapes = law->shapes};
  }
  static const std::map<std::string_view, Recipe> recipes = {
      {"illumination.ambient_light",
       {.shapes = {{"gradient_u_relative", -0.4, 0.4, false},
                   {"gradient_v_relative", -0.4, 0.4, false}}}},
      {"illumination.power_drift", {.shapes = {{"drift_time_s", 150, 1200}}}},
      {"illumination.line_nonuniformity",
       {.shapes = {{"ripple_period_deg", 1, 8}, {"ripple_phase_deg", -180, 180, false}}}},
      {"optics.lens_reflection",
       {.shapes = {{"displacement_v_m", 3e-5, 3e-4, true, true},
                   {"displacement_u_m", -3e-4, 3e-4, false}}}},
      {"illumination.ghost_line", {.shapes = {{"ghost_offset_m", 1e-3, 4e-3, true, true}}}},
      {"surface.subsurface_scattering", {.shapes = {{"spread_m", 1e-4, 1e-3}}}},
      {"surface.albedo_texture", {.shapes = {{"texture_length_m", 3e-4, 5e-3}}}},
      {"optics.veiling_glare", {.shapes = {{"halo_radius_m", 5e-5, 6e-4}}}},
      {"optics.mechanical_vignetting",
       {.shapes = {{"rim_shift_per_tangent_m", 0.01, 0.03, true, true}}, .geometric = true}},
      {"optics.polygon_aperture", {.whole_numbers = true}},
      {"optics.cover_glass_etalon",
       {.shapes = {{"fringe_period_px", 10, 120},
                   {"fringe_direction_deg", -180, 180, false},
                   {"fringe_phase_deg", 0, 0, false}}}},  // drawn for the camera as it is
      {"optics.dust", {.whole_numbers = true}},
      {"sensor.lower_full_well", {.geometric = true}},
      {"sensor.blooming",
       {.shapes = {{"threshold_electrons", 0.3, 0.9, false, false, true}, {"reach_px", 5, 60}}}},
      {"sensor.micro_lens_vignetting", {.shapes = {{"roll_off_order", 2, 8}}}},
      {"sensor.adc_missing_bits", {.whole_numbers = true}},
      {"sensor.adc_inl", {.shapes = {{"inl_cycles", 1, 8}}}},
      {"time.vibration_blur", {.shapes = {{"vibration_frequency_hz", 20, 300}}}},
      {"time.ambient_flicker",
       {.shapes = {{"flicker_depth", 0.3, 1, false}, {"flicker_frequency_hz", 45, 130}}}},
      {"variant.power_step", {.shapes = {{"step_time_s", 300, 1200, false}}}},
      {"variant.power_oscillation", {.shapes = {{"period_s", 250, 1000}}}},
      {"variant.beam_side_lobes", {.shapes = {{"lobe_offset_radii", 1.8, 4}}}},
      {"variant.beam_pedestal", {.shapes = {{"width_ratio", 2.5, 6}}}},
      {"variant.line_step", {.shapes = {{"step_angle_deg", -2.5, 2.5, false}}}},
      {"variant.fading_ambient_light", {.shapes = {{"fading_time_s", 200, 800}}}},
      {"variant.gaussian_scattering", {.shapes = {{"spread_m", 4e-4, 2e-3}}}},
      {"variant.ring_halo", {.shapes = {{"ring_radius_m", 1e-4, 4e-4}}}},
      {"variant.power_law_halo", {.shapes = {{"halo_radius_m", 1.5e-5, 1e-4}}}},
      {"variant.knee_response", {.shapes = {{"knee_relative", 0.2, 0.6, false}}}},
      {"variant.dark_warm_up", {.shapes = {{"warm_up_time_s", 80, 400}}}},
  };
  const auto found = recipes.find(effect.description().id);
  return found == recipes.end() ? Recipe{} : found->second;
}

const ShapeRange* FindShape(const Recipe& recipe, std::string_view parameter) {
  for (const ShapeRange& shape : recipe.shapes) {
    if (shape.parameter == parameter) return &shape;
  }
  return nullptr;
}

// `place` in [0, 1] of the range.
double ShapeValue(const ShapeRange& shape, const Sensor& camera, double place) {
  const double unit = shape.of_full_scale ? camera.largest_dn() / camera.gain_dn_per_electron : 1.0;
  if (shape.logarithmic) return unit * shape.low * std::pow(shape.high / shape.low, place);
  return unit * (shape.low + (shape.high - shape.low) * place);
}

// Efficiencies of colours that the camera does not have change nothing.
bool IsDead(const Effect& effect, size_t parameter, const Sensor& camera) {
  return camera.colour_filter == ColourFilter::kMono && parameter > 0 &&
         effect.description().id == "sensor.qe_error";
}

void SetLargestScale(EffectFamily& family) {
  const std::vector<EffectParameter>& parameters = family.effect->description().parameters;
  if (family.geometric) {
    family.largest_scale = 1;
    return;
  }
  family.largest_scale = 1e9;
  for (size_t k = 0; k < parameters.size(); ++k) {
    const double d = family.direction[k];
    if (d == 0) continue;
    const double bound = d > 0 ? parameters[k].upper : parameters[k].lower;
    family.largest_scale = std::min(family.largest_scale, (bound - family.shape[k]) / d);
  }
}

}  // namespace

ActiveEffect EffectFamily::At(double scale) const {
  ActiveEffect active{effect, shape};
  const std::vector<EffectParameter>& parameters = effect->description().parameters;
  for (size_t k = 0; k < parameters.size(); ++k) {
    double& value = active.parameters[k];
    if (k == 0 && geometric) {
      value *= std::pow(parameters[0].lower / value, scale);
    } else {
      value += scale * direction[k];
    }
    if (k == 0 && whole_numbers) value = std::round(value);
    value = std::clamp(value, parameters[k].lower, parameters[k].upper);
  }
  return active;
}

std::vector<const Effect*> VocabularyEffects() {
  std::vector<const Effect*> effects;
  for (const Effect* effect : AllEffects()) {
    const std::string_view id = effect->description().id;
    if (id == "optics.tangential_distortion" || id == "optics.natural_vignetting") continue;
    effects.push_back(effect);
  }
  return effects;
}

bool ShowsBeyondTheMean(const Effect& effect) {
  if (const OutsideLaw* law = FindOutsideLaw(effect.description().id)) {
    return law->shows_beyond_the_mean;
  }
  constexpr std::array kIds = {"illumination.power_noise",
                               "illumination.partial_coherence",
                               "surface.depolarisation",
                               "surface.albedo_texture",
                               "optics.dust",
                               "optics.cover_glass_etalon",
                               "optics.lens_reflection",
                               "sensor.prnu",
                               "sensor.dsnu_column_pattern",
                               "sensor.hot_pixels",
                               "sensor.crosstalk",
                               "sensor.brighter_fatter",
                               "sensor.read_noise_excess",
                               "sensor.row_noise",
                               "sensor.adc_missing_bits",
                               "sensor.image_lag",
                               "time.plate_motion",
                               "time.vibration_blur",
                               "time.exposure_jitter",
                               "variant.defocus_speckle_loss"};
  return std::find(kIds.begin(), kIds.end(), effect.description().id) != kIds.end();
}

EffectFamily DrawFamily(const Effect& effect, const Sensor& camera, CounterRandom& random) {
  const Recipe recipe = RecipeOf(effect);
  EffectFamily family;
  family.effect = &effect;
  family.geometric = recipe.geometric;
  family.whole_numbers = recipe.whole_numbers;
  const std::vector<EffectParameter>& parameters = effect.description().parameters;
  int strengths = 0;
  for (size_t k = 0; k < parameters.size(); ++k) {
    strengths += FindShape(recipe, parameters[k].name) == nullptr && !IsDead(effect, k, camera);
  }
  for (size_t k = 0; k < parameters.size(); ++k) {
    const EffectParameter& parameter = parameters[k];
    // Drawn in any case, so that what one effect leaves out does not change what follows.
    const double place = random.Uniform(), sign = random.Uniform() < 0.5 ? -1 : 1;
    if (const ShapeRange* shape = FindShape(recipe, parameter.name)) {
      const double value = (shape->either_sign ? sign : 1) * ShapeValue(*shape, camera, place);
      family.shape.push_back(std::clamp(value, parameter.lower, parameter.upper));
      family.direction.push_back(0);
      continue;
    }
    family.shape.push_back(parameter.null_value);
    double direction = 0;
    if (!IsDead(effect, k, camera)) {
      // Several strengths: ratios between 1:4 and 4:1.
      direction = parameter.prior_scale * (strengths > 1 ? std::pow(2, 2 * place - 1) : 1);
      const bool both =
          parameter.lower < parameter.null_value && parameter.upper > parameter.null_value;
      if (both) direction *= sign;
      if (parameter.upper <= parameter.null_value) direction *= -1;
    }
    family.direction.push_back(direction);
  }
  SetLargestScale(family);
  if (effect.description().id == "optics.polygon_aperture") {
    // Fewer blades are more of an effect: 9 down to 4, no smooth strength.
    family.shape[0] = 4 + std::floor(6 * random.Uniform());
    family.direction[0] = 0;
    family.largest_scale = 1;
  }
  return family;
}

ScaledEffect ScaleToGain(const EffectFamily& family, const ExpectedGain& gain, double target) {
  assert(target > 0);
  constexpr int kMostEvaluations = 24;
  constexpr double kClose = 0.05;
  ScaledEffect best;
  const auto evaluate = [&](double scale) {
    const ActiveEffect effect = family.At(scale);
    const double value = gain({effect});
    // Beyond sense, e.g. a closed pupil: too strong, and nothing to keep.
    if (!std::isfinite(value)) return std::numeric_limits<double>::infinity();
    const double error = std::abs(std::log(std::max(value, 1e-300) / target));
    const double so_far = std::abs(std::log(std::max(best.gain, 1e-300) / target));
    if (best.effect.effect == nullptr || error < so_far) {
      best.effect = effect;
      best.scale = scale;
      best.gain = value;
    }
    return value;
  };
  double low = 0, high = family.largest_scale;
  bool high_known = false;
  const bool has_strength =
      family.geometric || std::any_of(family.direction.begin(), family.direction.end(),
                                      [](double d) { return d != 0; });
  // Without: what was drawn is all there is.
  double scale = std::min(family.geometric ? 0.5 : 0.3, high);
  if (!has_strength) evaluate(family.largest_scale);
  for (int i = 0; has_strength && i < kMostEvaluations; ++i) {
    const double value = evaluate(scale);
    if (std::abs(std::log(std::max(value, 1e-300) / target)) < kClose) break;
    if (value < target) {
      if (scale >= family.largest_scale) break;
      low = scale;
    } else {
      high = scale;
      high_known = true;
    }
    if (high - low < 1e-6 * high) break;
    // The gain grows with the square of the strength, if that is small.
    const double guess = scale * std::clamp(std::sqrt(target / std::max(value, 1e-300)), 1e-3, 8.);
    if (guess > low && guess < high && i % 3 != 2) {
      scale = guess;
    } else if (!high_known) {
      scale = std::min(family.largest_scale, guess);
    } else {
      scale = low > 0 && !family.geometric ? std::sqrt(low * high) : 0.5 * (low + high);
    }
  }
  if (best.effect.effect == nullptr) best.effect = family.At(0);
  best.reached = std::abs(std::log(std::max(best.gain, 1e-300) / target)) < kClose;
  if (best.gain < 1e-6 && ShowsBeyondTheMean(*family.effect)) {
    best.gain = 0;
    best.gain_known = false;
    best.scale = std::min(family.largest_scale, target < 10 ? 1.0 : target < 50 ? 2.0 : 4.0);
    best.effect = family.At(best.scale);
  }
  return best;
}

}  // namespace sightline::bench
