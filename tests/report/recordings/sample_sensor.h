// SPDX-License-Identifier: Apache-2.0
// Diagnosis of a camera as it might come back: made up, but with every field filled.
#pragma once

#include "sightline/v1/sensor_set.pb.h"

namespace sightline {

v1::SensorDiagnosis SampleSensorDiagnosis();

}  // namespace sightline
