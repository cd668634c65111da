// SPDX-License-Identifier: Apache-2.0
// Diagnosis of a camera from flat-field and dark frames: its values by maximum likelihood and by
// the definitions of EMVA 1288, and departures from the linear model of EMVA 1288
// (docs/diagnosis.md).
#pragma once

#include "absl/status/statusor.h"
#include "render_worker/sensor_diagnosis/sensor_frames.h"
#include "sightline/v1/sensor_set.pb.h"

namespace sightline {

// `set` must be valid (CheckSensorSet). Images are read one after the other, so only a few are in
// memory. INVALID_ARGUMENT names an image whose size differs from the set's or with values above
// 2^bits - 1; errors of `hooks.read_image`; CANCELLED.
absl::StatusOr<v1::SensorDiagnosis> DiagnoseSensor(const v1::SensorSet& set,
                                                   const SensorDiagnosisHooks& hooks);

}  // namespace sightline
