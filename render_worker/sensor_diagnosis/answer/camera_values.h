// SPDX-License-Identifier: Apache-2.0
// Values of the camera: fitted ones, those by EMVA 1288, and the camera file.
#pragma once

#include <string>
#include <vector>

#include "render_worker/sensor_diagnosis/fixed_pattern/fixed_pattern.h"
#include "render_worker/sensor_diagnosis/photon_transfer/standard_values.h"
#include "render_worker/sensor_diagnosis/photon_transfer/transfer_terms.h"
#include "sightline/v1/sensor_set.pb.h"

namespace sightline {

// All measurements of a camera.
struct MeasuredCamera {
  const v1::SensorSet& set;
  const FlatFieldSteps& steps;
  Saturation saturation;
  StandardValues standard;
  TransferAnalysis transfer;
  FixedPatterns patterns;
};

// Sets `quantities`, `camera` and `curves` (patterns of columns and rows), and adds warnings about
// default values in the camera file.
void AddCameraValues(const MeasuredCamera& measured, v1::SensorDiagnosis* answer);

}  // namespace sightline
