// The scanner: camera, laser line projector, linear stage and their solid bodies.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <variant>
#include <vector>

namespace sightline {

// Pinhole camera, square pixels, principal point in the image centre.
struct Camera {
  int columns_px = 512;
  int rows_px = 512;
  double vertical_fov_rad = 0.78539816339744831;  // 45 degrees
  std::optional<double> pixel_pitch_m;

  // Distance of the pinhole from the image plane in pixels.
  double FocalLengthPx() const;
};

// Thin lens focused on the origin of the rig.
struct Lens {
  double focal_length_m = 0.016;
  double f_number = 8;
};

struct Laser {
  // Distance from source to origin; unset: the camera distance of the measurement.
  std::optional<double> distance_m;
  double fan_angle_rad = 1.5707963267948966;  // 90 degrees, full angle
};

struct BoxBody {
  Eigen::Vector3d centre_m;
  Eigen::Vector3d size_m;  // full edge lengths
};
// Axis along z of the sensor frame.
struct CylinderBody {
  Eigen::Vector3d centre_m;
  double radius_m;
  double length_m;
};
// Solid in its sensor's frame: origin at the pupil or source, z towards the rig's origin, x along
// the image rows.
using Body = std::variant<BoxBody, CylinderBody>;

struct Rig {
  Camera camera;
  std::optional<Lens> lens;
  Laser laser;
  double scan_step_m = 1e-3;
  double stage_travel_m = 1.0;
  double max_range_m = 1.5;
  std::vector<Body> camera_bodies = {BoxBody{{0, 0, -0.06}, {0.06, 0.06, 0.12}}};
  std::vector<Body> laser_bodies = {BoxBody{{0, 0, -0.06}, {0.04, 0.04, 0.12}}};
};

}  // namespace sightline
