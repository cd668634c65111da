// SPDX-License-Identifier: Apache-2.0
// Says from flat-field and dark frames what a camera is, by maximum likelihood and by the
// definitions of EMVA 1288, and which physics the linear model leaves out (docs/sensor-sets.md).
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "core/image/image.h"
#include "sightline/v1/sensor_set.pb.h"

namespace sightline {

struct SensorDiagnosisHooks {
  // Reads an image of the set by its name.
  std::function<absl::StatusOr<Image<uint16_t>>(const std::string& file)> read_image;
  std::function<void(double fraction, std::string_view what)> on_progress = nullptr;
  const std::atomic<bool>* cancelled = nullptr;  // checked between images
};

// `set` is valid (CheckSensorSet). Images are read one after the other; memory is that of a few.
// INVALID_ARGUMENT names the image: another size than the set says, numbers above 2^bits - 1;
// errors of `read_image`; CANCELLED.
absl::StatusOr<v1::SensorDiagnosis> DiagnoseSensor(const v1::SensorSet& set,
                                                   const SensorDiagnosisHooks& hooks);

}  // namespace sightline
