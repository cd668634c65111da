// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/calibrated_part.h"

#include <cmath>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"

namespace sightline {
namespace {

// Spectrum of the light from all around that was fitted.
constexpr char kSurroundings[] = "d65";
constexpr int kDefaultBounces = 4;
constexpr double kMostRadiance_w_m2_sr = 1e6;
constexpr double kMostElectrons = 1e9;
// Deviation from 1 that a factor of reflected light may have without a warning.
constexpr double kFactorTolerance = 0.05;

double Parameter(const v1::Effect& effect, const std::string& name) {
  const auto found = effect.parameters().find(name);
  return found == effect.parameters().end() ? 0 : found->second;
}

class PartCalibration : private InspectionChanges {
 public:
  explicit PartCalibration(CalibratedInspection* result)
      : InspectionChanges(result), inspection_(result->inspection) {}

  void ApplyDeviation(const std::string& name, double value) {
    if (name == "laser_factor") {
      Scale({inspection_.mutable_laser(), "power_w", 0.023, 1e-12, 100}, "laser.", 1 + value, name);
    } else if (name == "dark_mean_electrons") {
      ShiftDarkMean(value, name);
    } else if (name == "lamp_factor") {
      v1::Lighting* lighting = inspection_.mutable_lighting();
      if (lighting->has_ambient()) {
        Scale({lighting->mutable_ambient(), "radiance_w_m2_sr", 0, 0, kMostRadiance_w_m2_sr},
              "lighting.ambient.", 1 + value, name);
      }
      for (int i = 0; i < lighting->area_lights_size(); ++i) {
        Scale({lighting->mutable_area_lights(i), "radiance_w_m2_sr", 0, 0, kMostRadiance_w_m2_sr},
              absl::StrCat("lighting.area_lights[", i, "]."), 1 + value, name);
      }
    }
  }

  void ApplyEffect(const v1::Effect& effect) {
    const std::string& id = effect.effect();
    if (id == "illumination.interreflection") {
      inspection_.mutable_render()->set_laser_interreflection(true);
      Note(absl::StrCat("render.laser_interreflection true (", id, ")"));
      AllowBounces(effect);
    } else if (id == "illumination.lamp_interreflection") {
      AllowBounces(effect);
    } else if (id == "illumination.ambient_light") {
      AddSurroundings(Parameter(effect, "ambient_radiance_w_m2_sr"), id);
    } else if (id == "sensor.black_level_error") {
      ShiftDarkMean(Parameter(effect, "black_level_shift_electrons"), id);
    } else if (id == "illumination.laser_stray_light") {
      Warn(absl::StrCat(id, ": an inspection cannot say it: left out"));
    } else {
      AddEffect(effect);
    }
  }

 private:
  void ShiftDarkMean(double shift, const std::string& source) {
    Shift({inspection_.mutable_camera()->mutable_sensor(), "dark_mean_electrons", 0, 0,
           kMostElectrons},
          "camera.sensor.", shift, source);
  }

  void AllowBounces(const v1::Effect& effect) {
    v1::RenderSettings* render = inspection_.mutable_render();
    if (render->has_max_bounces() && render->max_bounces() == 0) {
      render->set_max_bounces(kDefaultBounces);
      Note(absl::StrCat("render.max_bounces 0 -> ", kDefaultBounces, " (", effect.effect(), ")"));
    }
    const double factor = Parameter(effect, "interreflected_light_factor");
    if (std::abs(factor - 1) <= kFactorTolerance) return;
    Warn(absl::StrCat(effect.effect(), ": there is ", NumberText(factor),
                      " times the light that the materials lead to expect; this factor is left "
                      "out, their reflectance may be wrong"));
  }

  void AddSurroundings(double radiance_w_m2_sr, const std::string& source) {
    v1::Lighting::Ambient* ambient = inspection_.mutable_lighting()->mutable_ambient();
    const bool lit = ambient->radiance_w_m2_sr() > 0;
    if (lit && ambient->spectrum().illuminant() != kSurroundings) {
      Warn(
          absl::StrCat(source, ": lighting.ambient is given with another spectrum: left as it is"));
      return;
    }
    ambient->mutable_spectrum()->set_illuminant(kSurroundings);
    Shift({ambient, "radiance_w_m2_sr", 0, 0, kMostRadiance_w_m2_sr}, "lighting.ambient.",
          radiance_w_m2_sr, source);
  }

  v1::Inspection& inspection_;
};

}  // namespace

CalibratedInspection CalibratePartInspection(const v1::Inspection& inspection,
                                             const v1::Diagnosis& diagnosis) {
  CalibratedInspection result;
  result.inspection = inspection;
  PartCalibration calibration(&result);
  for (const v1::FittedDeviation& deviation : diagnosis.model_fit().deviations()) {
    if (!std::isfinite(deviation.value()) || deviation.value() == 0) continue;
    calibration.ApplyDeviation(deviation.name(), deviation.value());
  }
  for (const v1::Effect& effect : diagnosis.calibrated_effects()) calibration.ApplyEffect(effect);
  return result;
}

}  // namespace sightline
