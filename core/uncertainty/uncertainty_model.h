// SPDX-License-Identifier: Apache-2.0
// Known errors of a measurement, and prior knowledge of the surface (thesis 3.3.3, 3.4), as
// validated values: SI units, pixels, radians.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/triangulation/triangulation.h"
#include "sightline/v1/uncertainty.pb.h"

namespace sightline {

// Standard deviation u_px of the detected centre of the laser line, the same along rows and columns
// of the image, as a function of where a point is seen from. Planning of the optics hands its
// results in as such a table.
struct LineDetectionNoise {
  // A table over distance from the camera and angle of incidence at one exposure time. Both axes
  // are increasing and have at least one entry; one of each: a constant.
  std::vector<double> distances_m = {1};
  std::vector<double> incidence_angles_rad = {0};
  std::vector<double> standard_deviations_px = {0.2};  // [distance][angle]

  bool IsConstant() const { return standard_deviations_px.size() == 1; }
  // Linear between the entries, constant beyond the ends.
  double At(double distance_m, double incidence_angle_rad) const;
  friend bool operator==(const LineDetectionNoise&, const LineDetectionNoise&) = default;
};

// How the scans of different set-ups are joined (v1::Uncertainty::Registration).
enum class RegistrationMethod { kNone, kBestFit, kDatumFeatures, kKnownPoses };

struct UncertaintyModel {
  LineDetectionNoise detection;
  // Over the variables of Table 3.1; those of detection are 0 here. Zero: no calibration errors.
  TriangulationCovariance calibration = TriangulationCovariance::Zero();
  bool calibration_assumed = false;  // CalibrationOnSite, because none is stated
  double prior_standard_deviation_m = 0.01;
  double resolution_m = 0.003;
  RegistrationMethod registration = RegistrationMethod::kNone;
  // With kKnownPoses: standard deviations of the part's pose along and about each axis.
  double registration_position_m = 0;
  double registration_angle_rad = 0;

  bool HasCalibrationErrors() const { return !calibration.isZero(0); }
};

// Covariance of the variables of detection for a point at `position_m` on a surface with the unit
// normal `normal`, in the frame that `camera` is given in; all others are 0.
TriangulationCovariance DetectionCovariance(const UncertaintyModel& model, const SensorPose& camera,
                                            const Eigen::Vector3d& position_m,
                                            const Eigen::Vector3d& normal);

// INVALID_ARGUMENT names `context`, field, value and allowed range; a covariance must be symmetric
// and positive semidefinite.
absl::StatusOr<UncertaintyModel> ParseUncertainty(const v1::Uncertainty& message,
                                                  const std::string& context);
// Calibration of a rig on site, by current defaults where none is stated: the variables of thesis
// Table 3.1 with independent standard deviations of 0.001 degrees for camera and sheet, 0.01 mm for
// their places, 0.2 px for the focal length and 0.1 px for the principal point. At 0.4 m and 30
// degrees a point has a standard deviation of 0.042 mm in depth with a focal length of 2400 px, and
// of 0.116 mm with the 618 px of the default camera, most of it by the principal point. A published
// line sensor has a nonlinearity of 0.04 % of its range of 100 mm (Sensors 18(2) 504, 2018). It is
// an assumption, not a measurement of anybody's rig.
TriangulationCovariance CalibrationOnSite();

// Every default written out: a constant or a table of one exposure time, and the full covariance.
// The registration is left out: the coverage service does not join set-ups.
v1::Uncertainty UncertaintyToProto(const UncertaintyModel& model);

}  // namespace sightline
