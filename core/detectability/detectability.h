// SPDX-License-Identifier: Apache-2.0
// Limits by the light that reaches the camera (v1::Detectability): for every material the exposure
// times that show the laser line, as a function of the directions to camera and laser; and the
// permitted exposure times.
//
//   const ExposureTable table(detectability.materials[0]);
//   const ExposureRange needed = table.At(camera_distance_m, laser_distance_m, cos_camera,
//                                         cos_laser, cos_between);
//   if (needed.shortest_s > longest_permitted_s) ...  // too dark
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "sightline/v1/detectability.pb.h"

namespace sightline {

// Default range of exposure times of a camera whose file states none (v1::Sensor).
inline constexpr double kShortestExposure_s = 10e-6;
inline constexpr double kLongestExposure_s = 1;

// Exposure times that show the line. Infinite shortest time: no exposure does. Infinite longest
// time: no exposure is too long.
struct ExposureRange {
  double shortest_s = std::numeric_limits<double>::infinity();
  double longest_s = std::numeric_limits<double>::infinity();
};

// A validated v1::DetectabilityOfMaterial. Axes are increasing and have at least one entry. Times
// are positive or infinite; a finite shortest one is at most the longest.
struct MaterialExposures {
  std::string part_material;  // empty: every surface without an entry of its own
  std::vector<double> camera_distances_m;
  std::vector<double> camera_incidence_rad, laser_incidence_rad;
  std::vector<double> azimuth_rad;
  double laser_distance_m = 1;
  // [distance][camera incidence][laser incidence][azimuth]
  std::vector<double> shortest_s, longest_s;
};

struct Detectability {
  // Permitted exposure times as stated; unset: of the camera.
  std::optional<double> min_exposure_time_s, max_exposure_time_s;
  double min_detected_fraction = 0.9;
  // Empty: computed from rendered images.
  std::vector<MaterialExposures> materials;
};

// Interpolates the table of one material: linear in the logarithm of the times, constant beyond the
// ends of an axis. If the nearest entry is infinite, so is the result; otherwise infinite entries
// are left out.
class ExposureTable {
 public:
  explicit ExposureTable(const MaterialExposures& exposures);

  // Cosines of the angles between the surface's normal and the directions to camera and laser, and
  // between these two directions. Times grow in proportion to the laser's distance.
  ExposureRange At(double camera_distance_m, double laser_distance_m, double cos_camera,
                   double cos_laser, double cos_between) const;

  const std::vector<double>& camera_distances_m() const { return axes_[0]; }

 private:
  // Camera distance, incidence of camera and laser, azimuth.
  std::vector<double> axes_[4];
  double laser_distance_m_;
  std::vector<double> log_shortest_, log_longest_;
};

// INVALID_ARGUMENT names `context`, field, value and allowed range: times outside (0, 100] s, a
// fraction outside (0, 1], an axis that does not increase, a table of the wrong size, two entries
// for one material.
absl::StatusOr<Detectability> ParseDetectability(const v1::Detectability& message,
                                                 const std::string& context);

}  // namespace sightline
