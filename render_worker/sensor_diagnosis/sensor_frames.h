// SPDX-License-Identifier: Apache-2.0
// Reads the images of a sensor set one by one and reduces each step to its statistics.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "core/image/image.h"
#include "render_worker/sensor_diagnosis/flat_field_statistics.h"
#include "sightline/v1/sensor_set.pb.h"

namespace sightline {

// Averages of fewer frames contain more temporal noise than pattern. Chosen.
inline constexpr int kFewestFramesOfPattern = 8;

// Share of reading in the reported progress; the rest are fits and tests. Chosen.
inline constexpr double kReadingShare = 0.8;

struct SensorDiagnosisHooks {
  // Reads an image of the set by its name.
  std::function<absl::StatusOr<Image<uint16_t>>(const std::string& file)> read_image;
  std::function<void(double fraction, std::string_view what)> on_progress = nullptr;
  const std::atomic<bool>* cancelled = nullptr;  // checked between images
};

struct SensorSetStatistics {
  std::vector<FlatFieldStatistics> steps;
  // Counts of all raw numbers of all frames; 65536 elements.
  std::vector<int64_t> counts = std::vector<int64_t>(65536, 0);
};

// `set` must be valid (CheckSensorSet). Reports progress up to kReadingShare. INVALID_ARGUMENT
// names an image whose size differs from the set's or with values above 2^bits - 1; errors of
// `read_image`; CANCELLED.
absl::StatusOr<SensorSetStatistics> ReadSensorFrames(const v1::SensorSet& set,
                                                     const SensorDiagnosisHooks& hooks);

// Steps of a set with and without light. Holds references to its source statistics.
struct FlatFieldSteps {
  explicit FlatFieldSteps(std::span<const FlatFieldStatistics> steps);

  // The dark step with the nearest exposure time; nullptr if there is none.
  const FlatFieldStatistics* NearestDark(double exposure_time_s) const;
  // Mean of that step; 0 if there is none.
  double DarkMeanDn(double exposure_time_s) const;
  // Mean minus dark mean of a step with light; 0 for a dark step.
  double SignalDn(const FlatFieldStatistics& step) const;

  std::span<const FlatFieldStatistics> all;
  std::vector<const FlatFieldStatistics*> dark, bright;
};

}  // namespace sightline
