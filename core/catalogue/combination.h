// SPDX-License-Identifier: Apache-2.0
// Geometry of the combination of a camera and a lens of a catalogue. A thin lens of focal length f,
// focused at the distance z in front of it, has its image at b behind it:
//   1/f = 1/z + 1/b,   so   b = f z / (z - f)   and the magnification   m = b / z = f / (z - f).
// Distances in metres, f-numbers without unit; everywhere z_m > f.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/catalogue/catalogue.h"

namespace sightline {

// Side of the square that one pixel sees of a plane at z, perpendicular to the axis: p / m for a
// pixel pitch p. Above 0.
double PixelFootprint(const Sensor& sensor, const Lens& lens, double z_m);

struct FieldOfView {
  double width_m, height_m;  // along the rows and along the columns of the sensor
};
// Field of view of the whole sensor in the plane at z: the footprint times columns and rows.
FieldOfView FieldOfViewAt(const Sensor& sensor, const Lens& lens, double z_m);

struct DepthOfField {
  double near_m, far_m;  // distances from the lens; far_m is infinite from some z on

  double depth_m() const { return far_m - near_m; }
};
// A point at the distance s is sharp at b_s; on the sensor, at b, it is a disc of the diameter
//   c(s) = D |b_s - b| / b_s = D b |1/s - 1/z|,   with the pupil's diameter D = f / f_number
// (similar triangles; then 1/b - 1/b_s = 1/s - 1/z). It is no larger than `circle_m` between
//   1/near = 1/z + circle / (D b)   and   1/far = 1/z - circle / (D b),
// infinite if that is not above 0. f_number and circle_m above 0. Diffraction is left out.
DepthOfField DepthOfFieldAt(const Lens& lens, double z_m, double f_number, double circle_m);

double SensorDiagonal(const Sensor& sensor);

// True if the image circle of the lens covers the sensor to its corners. Data sheets round both, so
// an excess of 1 % is allowed (a 2/3" sensor of 11.07 mm and a lens "for 2/3", 11 mm"). Also
// true if the image circle is not known.
bool ImageCircleHolds(const DeviceLens& lens, const Sensor& sensor);

enum class MountFit {
  kFits,
  // A C lens on a CS camera: the flange of CS is 5 mm nearer to the sensor (12.526 mm instead of
  // 17.526 mm), which a spacer ring compensates. A CS lens does not fit a C camera.
  kFitsWithRing,
  kDoesNotFit,
};
MountFit FitOfMounts(const std::string& lens_mount, const std::string& camera_mount);

// True if the lens can be focused at z: beyond its focal length and not nearer than its least focus
// distance. z may have any value.
bool FocusesAt(const DeviceLens& lens, double z_m);

// Length of the laser's line at a distance z_m > 0 from it: 2 z tan(fan angle / 2).
double LineLength(const Laser& laser, double z_m);

// Requirements on a combination; unset: anything.
struct FitRequirements {
  std::optional<double> max_pixel_footprint_m;
  // Field of view along the laser line, which the camera sees along its rows.
  std::optional<double> min_field_of_view_m;
  // Depth of field with a circle of confusion of one pixel, at any f-number of the lens.
  std::optional<double> min_depth_of_field_m;
};

// Reasons why the devices do not meet the requirements at the working distance z_m > 0, one
// sentence each with its numbers; empty: they do. Camera and laser are both assumed to be z_m away.
std::vector<std::string> WhyUnfit(const DeviceCamera& camera, const DeviceLens& lens,
                                  const DeviceLaser& laser, double z_m,
                                  const FitRequirements& required);

}  // namespace sightline
