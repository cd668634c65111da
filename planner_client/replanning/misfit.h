// SPDX-License-Identifier: Apache-2.0
// Detects reasons why points do not fit the part: another unit, a mirrored cloud, the points of
// another scan.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/registration/rigid_registration.h"
#include "core/registration/surface_index.h"
#include "core/rig/measurement.h"
#include "core/rig/rig.h"

namespace sightline {

// Measures of how badly points fit the part at its registered pose.
struct Misfit {
  double residual_m = 0;    // robust standard deviation of the distances
  double fraction_off = 1;  // FractionOff
};

// Fraction of the points that are more than 1 mm from the part in this pose.
double FractionOff(const SurfaceIndex& model, std::span<const Eigen::Vector3d> points_m,
                   const PartPose& pose);

// Above this fraction the points may belong to a mirrored part; defects and clamps stay below.
inline constexpr double kSuspiciousFractionOff = 0.1;

// A sentence about the reason, or "" if none is found. `points_m`: points that do not fit.
//   unit    scaled by a usual factor they are as large as the model and lie on it
//   mirror  reflected in a coordinate plane, or in one through the model's centre, they fit with
//           less than a third of the residuals, or of the points that are off
std::string LikelyMisfit(const SurfaceIndex& model, std::span<const Eigen::Vector3d> points_m,
                         const PosePrior& prior, const Misfit& misfit);

// Fraction of the points that a scan may have measured: on surfaces that face camera and laser, and
// within the image. Occlusion is ignored. `rig` has the placement of the part.
double FractionInView(const Rig& rig, const Measurement& scan, const Eigen::Vector3d& part_centre_m,
                      std::span<const Eigen::Vector3f> positions_m,
                      std::span<const Eigen::Vector3f> normals);

// Index of a scan whose view contains nine tenths of the points, if the view of `own` contains less
// than half of them; nullopt if they may belong to `own`.
std::optional<size_t> OtherScanInView(const Rig& rig, std::span<const Measurement> scans,
                                      size_t own, const Eigen::Vector3d& part_centre_m,
                                      std::span<const Eigen::Vector3f> positions_m,
                                      std::span<const Eigen::Vector3f> normals);

}  // namespace sightline
