// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/calibrated_part.h"

#include <cmath>
#include <string>

namespace sightline {
namespace {

// Factors and the offset of the null model.
void ApplyDeviationOfPart(const std::string& name, double value, const v1::Inspection& inspection,
                          InspectionChanges* changes) {
  if (name == "laser_factor") {
    changes->Scale("laser.power_w", 1 + value, name);
  } else if (name == "dark_mean_electrons") {
    changes->Shift("camera.sensor.dark_mean_electrons", value, name);
  } else if (name == "lamp_factor") {
    if (inspection.lighting().has_ambient()) {
      changes->Scale("lighting.ambient.radiance_w_m2_sr", 1 + value, name);
    }
    changes->Scale("lighting.area_lights.radiance_w_m2_sr", 1 + value, name);
  }
}

}  // namespace

CalibratedInspection CalibratePartInspection(const v1::Inspection& inspection,
                                             const v1::Diagnosis& diagnosis) {
  CalibratedInspection result;
  result.inspection = inspection;
  InspectionChanges changes(&result);
  for (const v1::FittedDeviation& deviation : diagnosis.model_fit().deviations()) {
    if (!std::isfinite(deviation.value()) || deviation.value() == 0) continue;
    ApplyDeviationOfPart(deviation.name(), deviation.value(), inspection, &changes);
  }
  for (const v1::Effect& effect : diagnosis.calibrated_effects()) {
    changes.Carry(effect, ChangesOf(effect, diagnosis));
  }
  return result;
}

}  // namespace sightline
