// SPDX-License-Identifier: Apache-2.0
// Diagnosis of a camera from flat-field and dark frames: its values by maximum likelihood and by
// the definitions of EMVA 1288, and the physics that the linear model of EMVA 1288 lacks
// (docs/diagnosis.md).
#pragma once

#include "absl/status/statusor.h"
#include "render_worker/sensor_diagnosis/sensor_frames.h"
#include "sightline/v1/sensor_set.pb.h"

namespace sightline {

// `set` is valid (CheckSensorSet). Images are read one after the other, so memory is that of a few.
// INVALID_ARGUMENT names the image: another size than the set says, numbers above 2^bits - 1;
// errors of `hooks.read_image`; CANCELLED.
absl::StatusOr<v1::SensorDiagnosis> DiagnoseSensor(const v1::SensorSet& set,
                                                   const SensorDiagnosisHooks& hooks);

}  // namespace sightline
