// SPDX-License-Identifier: Apache-2.0
// Resolution and angles at which a scan measures its points: exact, from the points and the poses
// of camera and laser. These numbers contain no noise; core/triangulation computes their effect on
// the uncertainty of points.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "core/rig/measurement.h"
#include "core/rig/rig.h"
#include "core/rig/scan_geometry.h"
#include "core/targets/target_set.h"

namespace sightline {

struct PointQuality {
  // Side of a pixel at the point's depth, across the optical axis: depth over focal length in px.
  double pixel_footprint_m = 0;
  // Depth that corresponds to one pixel across the line: footprint over the sine of the
  // triangulation angle. Infinite where the line of sight lies in the laser plane.
  double depth_per_pixel_m = 0;
  // Between line of sight and laser plane, [0, pi/2].
  double triangulation_angle_rad = 0;
  // Between the surface's normal and the direction to the camera's pupil, and to the laser's
  // source; [0, pi], above pi/2 the surface faces away.
  double camera_incidence_rad = 0;
  double laser_incidence_rad = 0;
};

// Quality of a point with a unit normal. Both and the geometry are in world coordinates, with the
// stage where the point is lit. Points at the pupil or the source give NaN.
PointQuality QualityOfPoint(const Camera& camera, const ScanGeometry& geometry,
                            const Eigen::Vector3d& point_m, const Eigen::Vector3d& normal);

// Summary of values: the median, and the limits between which 95 of 100 lie (2.5 % and 97.5 %
// quantiles, linear between the two nearest values).
struct Spread {
  double low = 0, median = 0, high = 0;
};
// Spread of the finite values, of which at least one is needed.
Spread SpreadOf(std::vector<double> values);

struct ScanQuality {
  Spread pixel_footprint_m, depth_per_pixel_m;
  Spread triangulation_angle_rad, camera_incidence_rad, laser_incidence_rad;
};

// A measured point: position and unit normal in part coordinates, and the number of its frame (the
// stage is at frame * scan_step_m).
struct MeasuredPoint {
  Eigen::Vector3f position_m, normal;
  int frame = 0;
};

// Quality over the points of a scan; nothing without points.
std::optional<ScanQuality> QualityOfScan(const Rig& rig, const Measurement& measurement,
                                         const Eigen::Vector3d& part_centre_m,
                                         std::span<const MeasuredPoint> points);

// Depth per pixel [m] of every target for the scan that covers it best; 0 if no scan covers it.
// `measurements` and `covered` (one bit per target) are parallel. The stage is where the target
// itself is lit.
std::vector<float> BestDepthPerPixel(const Rig& rig, std::span<const Measurement> measurements,
                                     std::span<const TargetBits> covered,
                                     const Eigen::Vector3d& part_centre_m,
                                     const TargetSet& targets);

// Fraction of each scan's covered targets that others cover as well; 0 if it covers none.
std::vector<double> Overlaps(std::span<const TargetBits> covered);

}  // namespace sightline
