// SPDX-License-Identifier: Apache-2.0
// Findings to calibrate with, and the camera of the inspections that are calibrated.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "core/recordings/recordings.h"
#include "render_worker/calibration/inspection_change.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// A camera file, as JSON.
inline constexpr char kSensor[] = R"({"sensor_type": "mono", "pixel_pitch_m": 5.3e-6,
  "sensor_columns_px": 64, "sensor_rows_px": 48, "bit_depth_bit": 10,
  "quantum_efficiency": {"mono": 0.5}, "gain_dn_per_electron": 0.16,
  "saturation_capacity_electrons": 9893, "dark_mean_electrons": 27.5, "dark_noise_electrons": 6.5,
  "dark_current_electrons_per_s": 0})";

// Known to as much as its value: no finding is negligible.
inline void AddDeviation(v1::Diagnosis* diagnosis, const std::string& name, double value) {
  v1::FittedDeviation* deviation = diagnosis->mutable_model_fit()->add_deviations();
  deviation->set_name(name);
  deviation->set_value(value);
  deviation->set_standard_uncertainty(std::abs(value));
}

inline void AddEffect(v1::Diagnosis* diagnosis, const std::string& id,
                      const std::vector<std::pair<std::string, double>>& parameters) {
  v1::Effect* effect = diagnosis->add_calibrated_effects();
  effect->set_effect(id);
  for (const auto& [name, value] : parameters) (*effect->mutable_parameters())[name] = value;
}

// States how an inspection expresses an effect of the vocabulary, as a render worker does for
// recordings `set`.
inline void StateChanges(const v1::Effect& effect, const RecordingSet& set,
                         v1::Diagnosis* diagnosis) {
  std::vector<NamedValue> parameters;
  for (const auto& [name, value] : effect.parameters()) parameters.push_back({name, value});
  const auto active = MakeActiveEffect(effect.effect(), parameters);
  ASSERT_TRUE(active.ok()) << active.status();
  AddInspectionChanges(*active, set, diagnosis);
}

}  // namespace sightline
