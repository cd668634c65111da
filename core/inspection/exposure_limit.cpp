// SPDX-License-Identifier: Apache-2.0
#include "core/inspection/exposure_limit.h"

#include <algorithm>
#include <limits>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"

namespace sightline {
namespace {

double NearestCamera_m(const ParameterDomain& distance) {
  double nearest_m = std::numeric_limits<double>::infinity();
  for (const double value : distance.values) nearest_m = std::min(nearest_m, value);
  for (const ParameterDomain::Range& range : distance.ranges) {
    nearest_m = std::min(nearest_m, range.min);
  }
  return nearest_m;
}

// The camera cannot expose for shorter or longer than its file says, whatever is permitted.
absl::Status CheckWithinCamera(const Inspection& inspection, const Detectability& stated,
                               const std::string& context) {
  const double least_s = inspection.min_exposure_time_s, most_s = inspection.max_exposure_time_s;
  if (stated.max_exposure_time_s && *stated.max_exposure_time_s > most_s) {
    return absl::InvalidArgumentError(absl::StrCat(
        context, ": detectability.max_exposure_time_s is ", NumberText(*stated.max_exposure_time_s),
        " s, longer than the camera's longest exposure, ", NumberText(most_s),
        " s (max_exposure_time_s of the sensor)"));
  }
  if (stated.min_exposure_time_s && *stated.min_exposure_time_s < least_s) {
    return absl::InvalidArgumentError(absl::StrCat(
        context, ": detectability.min_exposure_time_s is ", NumberText(*stated.min_exposure_time_s),
        " s, shorter than the camera's shortest exposure, ", NumberText(least_s),
        " s (min_exposure_time_s of the sensor)"));
  }
  return absl::OkStatus();
}

}  // namespace

ExposureLimit LimitExposure(const CostModel& costs, double scan_step_m,
                            const OpticsPlanning& planning, double image_speed_px_per_m) {
  ExposureLimit limit;
  double speed = std::numeric_limits<double>::infinity();
  if (costs.stage_speed_m_per_s) speed = *costs.stage_speed_m_per_s;
  if (costs.frame_rate_hz) speed = std::min(speed, *costs.frame_rate_hz * scan_step_m);
  if (std::isfinite(speed)) limit.stage_speed_m_per_s = speed;
  if (planning.cost_px_per_s > 0) return limit;
  if (costs.frame_rate_hz) {
    limit.longest_s = 1 / *costs.frame_rate_hz;
    limit.because =
        absl::StrFormat("the frame time at costs.frame_rate_hz = %.4g Hz", *costs.frame_rate_hz);
  }
  if (std::isfinite(speed) && image_speed_px_per_m > 0) {
    const double blur_s = planning.max_motion_blur_px / (image_speed_px_per_m * speed);
    if (!limit.longest_s || blur_s < *limit.longest_s) {
      limit.longest_s = blur_s;
      limit.because = absl::StrFormat("motion blur of %.3g px at a stage speed of %.4g mm/s",
                                      planning.max_motion_blur_px, 1e3 * speed);
    }
  }
  return limit;
}

absl::StatusOr<PermittedExposures> PermittedExposuresOf(const Inspection& inspection,
                                                        const std::string& context) {
  PermittedExposures permitted{inspection.min_exposure_time_s, inspection.max_exposure_time_s,
                               "the camera"};
  const double image_speed_px_per_m =
      inspection.rig.camera.FocalLengthPx() /
      NearestCamera_m(inspection.domain.parameters[kCameraDistance]);
  const ExposureLimit limit =
      LimitExposure(inspection.stated_costs, inspection.rig.scan_step_m,
                    inspection.optics.value_or(OpticsPlanning()), image_speed_px_per_m);
  if (limit.longest_s && *limit.longest_s < permitted.longest_s) {
    permitted.longest_s = *limit.longest_s;
    permitted.longest_because = limit.because;
  }
  if (inspection.detectability) {
    const Detectability& stated = *inspection.detectability;
    SIGHTLINE_RETURN_IF_ERROR(CheckWithinCamera(inspection, stated, context));
    permitted.shortest_s = stated.min_exposure_time_s.value_or(permitted.shortest_s);
    if (stated.max_exposure_time_s) {
      permitted.longest_s = *stated.max_exposure_time_s;
      permitted.longest_because = "detectability.max_exposure_time_s";
    }
  }
  if (permitted.shortest_s > permitted.longest_s) {
    return absl::InvalidArgumentError(
        absl::StrCat(context, ": the shortest permitted exposure, ",
                     NumberText(permitted.shortest_s), " s, is longer than the longest, ",
                     NumberText(permitted.longest_s), " s (", permitted.longest_because, ")"));
  }
  return permitted;
}

}  // namespace sightline
