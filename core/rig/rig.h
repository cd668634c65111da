// SPDX-License-Identifier: Apache-2.0
// The scanner: camera, laser line projector, linear stage and their solid bodies.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <memory>
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

// Brown-Conrady distortion in normalised image coordinates (x/z, y/z): radial 1 + k1 r^2 + k2 r^4 +
// k3 r^6, tangential p1, p2. All zero: none.
struct Distortion {
  double k1 = 0, k2 = 0, k3 = 0, p1 = 0, p2 = 0;

  friend bool operator==(const Distortion&, const Distortion&) = default;
};

// Thin lens.
struct Lens {
  double focal_length_m = 0.016;
  double f_number = 8;
  // Distance on which it is focused; unset: the origin of the rig.
  std::optional<double> focus_distance_m;
  double transmission = 1;  // (0, 1]
  // Aperture: 0 blades is a circle, else a regular polygon of the same area.
  int aperture_blades = 0;
  double aperture_rotation_rad = 0;
  double obstruction_relative = 0;  // diameter of a central obstruction over that of the pupil
  // Wavefront error as Zernike coefficients [m rms], Noll's index 1, 2, ...; normalised to the
  // pupil.
  std::vector<double> zernike_m;
  Distortion distortion;
  // Turn of the sensor about its rows (x) and columns (y): its image distance is
  // b + u tan(sensor_tilt_y) + v tan(sensor_tilt_x). The keystone this makes belongs to the
  // calibration; images are in the coordinates of the perpendicular sensor.
  double sensor_tilt_x_rad = 0, sensor_tilt_y_rad = 0;
  // Adjustable range of the lens; unset: anything.
  std::optional<double> min_f_number, max_f_number, min_focus_distance_m;
};

enum class LineProfile {
  kPowell,    // uniform along the line
  kGaussian,  // cylindrical lens: Gaussian along the line, 1/e^2 at the ends of the fan
};

// Laser line projector: a Gaussian beam spread into a fan (thesis eq. 5.1-5.4).
struct Laser {
  // Distance from source to origin; unset: the camera distance of the measurement.
  std::optional<double> distance_m;
  double fan_angle_rad = 1.5707963267948966;  // 90 degrees, full angle
  LineProfile line_profile = LineProfile::kPowell;
  double wavelength_m = 661e-9;
  double power_w = 0.023;              // all of it reaches the line
  double divergence_rad = 0.24e-3;     // far-field half angle at 1/e^2, across the line
  double beam_focus_distance_m = 0.9;  // projector to waist
  double beam_quality_m2 = 1;          // waist m2 lambda / (pi divergence)
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

// Placement of a part that is not where its holder should have it. The point x of the part takes
// the place of the point  rotation (x - centre_m)  relative to the centre that offsets refer to.
struct PartPlacement {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();  // part coordinates
};

struct Rig {
  Camera camera;
  std::optional<Lens> lens;
  Laser laser;
  double scan_step_m = 1e-3;
  double stage_travel_m = 1.0;
  double max_range_m = 1.5;
  std::vector<Body> camera_bodies = {BoxBody{{0, 0, -0.06}, {0.06, 0.06, 0.12}}};
  std::vector<Body> laser_bodies = {BoxBody{{0, 0, -0.06}, {0.04, 0.04, 0.12}}};
  // Least gap between these bodies and part, table and obstacles.
  double clearance_m = 0;
  // Unset: the part is not turned; offsets refer to the centre of its bounding box.
  std::optional<PartPlacement> part_placement;
  // Points of the part, relative to the centre that offsets refer to, that include its lowest point
  // for every rotation: corners of its convex hull, or all its vertices if there are few scans.
  // Null if the height of a table under the part is not needed.
  std::shared_ptr<const std::vector<Eigen::Vector3d>> part_support_points_m;
};

}  // namespace sightline
