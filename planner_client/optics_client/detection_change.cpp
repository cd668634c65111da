// SPDX-License-Identifier: Apache-2.0
#include "planner_client/optics_client/detection_change.h"

#include <algorithm>
#include <cmath>

#include "core/field_limits/field_checks.h"
#include "core/status/status_macros.h"

namespace sightline {

absl::StatusOr<LineDetectionNoise> NoiseOf(const v1::LearnedDetection& learned) {
  v1::Uncertainty uncertainty;
  *uncertainty.mutable_line_detection()->mutable_table() = learned.table();
  SIGHTLINE_ASSIGN_OR_RETURN(auto model, ParseUncertainty(uncertainty, "learned detection"));
  return model.detection;
}

double MeanError(const v1::LearnedDetection& learned) {
  double squares = 0;
  for (const double error : learned.relative_standard_errors()) squares += error * error;
  return std::sqrt(squares / std::max(1, learned.relative_standard_errors_size()));
}

DetectionChange ChangeOf(const LineDetectionNoise& planned_for, double earlier_error,
                         const v1::LearnedDetection& learned) {
  const v1::LineDetection::Table& table = learned.table();
  double squares = 0, standardised = 0;
  int entries = 0;
  for (const double distance_m : table.distances_m()) {
    for (const double angle_deg : table.incidence_angles_deg()) {
      const double before = planned_for.At(distance_m, Radians(angle_deg));
      const double change = std::log(table.standard_deviations_px(entries) / before);
      const double error = std::hypot(learned.relative_standard_errors(entries), earlier_error);
      squares += change * change;
      standardised += change * change / (error * error);
      ++entries;
    }
  }
  return {std::sqrt(squares / std::max(1, entries)),
          std::sqrt(standardised / std::max(1, entries))};
}

}  // namespace sightline
