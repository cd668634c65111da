// SPDX-License-Identifier: Apache-2.0
// Finds the targets that a rig with its table can measure, among those measurable in free space.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/rig/rig.h"
#include "core/targets/target_set.h"
#include "coverage_server/collision/collision.h"
#include "coverage_server/detectability/light_map.h"
#include "coverage_server/measurability/place_measurement.h"
#include "coverage_server/visibility/visibility_field.h"

namespace sightline {

// A target counts as measurable in a domain if a scan was found that measures it: with parameters
// of the domain, in one of the orientations in which the part may lie, and by the exact conditions
// of PlaceMeasurement. So a target never counts if angle, resolution, occlusion or table prevent
// every scan of the domain. Candidates are pairs of directions in steps of 4 degrees that the
// visibility field leaves open. Each is tried with scans of the domain in steps of 2 degrees. A
// target that only scans between these steps measure may be missed. If alpha and beta are free,
// any orientation is assumed. Not checked: offsets, travel of the stage, collisions with anything
// but the table, and obstacles that stand still.
class DomainMeasurability {
 public:
  // `part_centre_m`: reference point of offsets. `field`, `occluders` and `light` must outlive it.
  // `light` and its map: null if light limits nothing.
  DomainMeasurability(const Rig& rig, const TargetSampling& sampling,
                      const MeasurementDomain& domain, const Eigen::Vector3d& part_centre_m,
                      const VisibilityField& field, const std::vector<Occluder>& occluders,
                      const LightLimit* light = nullptr, const LightMap* light_map = nullptr);

  // Least and largest angle between camera and laser within domain and limits; least above largest:
  // there is none.
  double min_angle_rad() const { return min_angle_rad_; }
  double max_angle_rad() const { return max_angle_rad_; }
  // No resting orientation nor a bounded alpha or beta: Keep changes nothing.
  bool any_orientation() const { return rests_.empty(); }

  // Clears the bits of targets in [begin, end) that are set in `measurable` but cannot be measured.
  // Sets bit r of a target's entry in `orientations` if it can be measured with the part in
  // orientation r of the domain. `orientations` is empty if the domain has no or more than 64
  // orientations. Stops early when *cancelled.
  void Keep(const TargetSet& targets, size_t begin, size_t end, const std::atomic<bool>* cancelled,
            TargetBits& measurable, std::vector<uint64_t>& orientations) const;

 private:
  // Directions of one half plane through the vertical, tilted along the laser line, at polar angles
  // kFirstPolar_deg + i kStep_deg. Cells are of the field's map and of the finer one.
  static constexpr int kPolars = 64;
  struct Arc {
    uint16_t cell[kPolars];
    uint16_t fine_cell[kPolars];
    double azimuth_rad;  // of the sensors as seen from a part that is not turned
    double gamma_rad;    // turn of the part at which a scan of the domain has this azimuth
    double tilt_rad;
  };
  struct Rest {
    double alpha_rad, beta_rad;
    Eigen::Matrix3f rotation;  // part to world, gamma = 0
    float table_height_m;      // over the part's centre
    std::vector<Arc> arcs;
  };
  // Scans of the domain that see a target at one pair of polar angles, at the least, median and
  // largest camera distance within the limits.
  struct PairScan {
    double theta_rad, tau_rad;
    double off_axis_rad;  // of the line of sight, towards the laser
    std::array<double, 3> distances_m;
    double CameraPolar() const { return theta_rad - off_axis_rad; }
    double LaserPolar() const { return theta_rad - tau_rad; }
  };
  // The scan in the middle of the cell of two steps, and those at its four corners.
  static constexpr int kPairScans = 5;
  using PairScans = std::array<PairScan, kPairScans>;
  struct AzimuthAndTurn {
    double azimuth_rad, gamma_rad;
  };
  struct TargetState;

  void AddRest(const Rig& rig, double alpha_rad, double beta_rad,
               const std::vector<AzimuthAndTurn>& azimuths);
  // Azimuths of the sensors as seen from a part that is not turned, each with a turn of the part.
  std::vector<AzimuthAndTurn> Azimuths(size_t most) const;
  // Turns of the part at which a scan of the domain has the azimuth; `gamma_rad` comes first.
  std::vector<double> TurnsAt(double azimuth_rad, double gamma_rad) const;
  // Sets allowed_lasers_, pair_scans_ and the angles.
  void AllowPairs(const Rig& rig, const TargetSampling& sampling, const MeasurementDomain& domain);
  void AddPairScan(int camera, int laser, const PairScan& scan);
  uint64_t ClearOfTable(const Rest& rest, const TargetState& state, int sensor) const;
  bool HasPair(uint64_t open, uint64_t cameras, uint64_t lasers) const;
  // Clears the bits of `open` whose directions are blocked, by segment tests.
  void ConfirmOpen(const Arc& arc, TargetState& state, uint64_t& open) const;
  bool MeasurableAt(const Rest& rest, TargetState& state) const;
  // True if scans of this pair of polar angles, or of a neighbour in azimuth, measure the target.
  bool PairMeasures(const Rest& rest, const Arc& arc, const PairScans& scans,
                    TargetState& state) const;
  // False if no permitted exposure shows the line for a direction with this cosine to the normal,
  // whatever the other direction is.
  bool MayHaveLight(const TargetState& state, float cosine) const;
  // False if no permitted exposure shows the line at any distance of the pair's scans. With some
  // tolerance, because the exact evaluation checks the remaining scans again.
  bool MayHaveLight(const PairScan& scan, TargetState& state, const Eigen::Vector3f& normal,
                    const Eigen::Vector3f& to_camera, const Eigen::Vector3f& to_laser) const;
  bool ScanMeasures(const Rest& rest, const PairScan& scan, double azimuth_rad, double gamma_rad,
                    double tilt_rad, TargetState& state) const;

  const VisibilityField& field_;
  const std::vector<Occluder>& occluders_;
  Eigen::Vector3f part_centre_m_;
  OctahedralMap fine_;
  std::vector<Eigen::Vector3f> fine_directions_;
  std::vector<Rest> rests_;
  // Bit l of entry c: camera at polar angle c, laser at l.
  uint64_t allowed_lasers_[kPolars] = {};
  uint64_t cameras_ = 0, lasers_ = 0;  // polar angles that are in a pair
  std::vector<PairScans> pair_scans_;  // of entry 64 c + l; valid where allowed_lasers_ has it
  double min_angle_rad_ = 0, max_angle_rad_ = 0;
  double tilt_rad_ = 0;
  float nearest_m_ = 0, farthest_m_ = 0;  // of the sensors from a target
  float drop_[2][kPolars] = {};           // lowest point of camera's and laser's bodies below it
  ParameterDomain azimuth_, gamma_;
  // Radius of the largest circle within the table about the part's centre; 0: no table.
  float table_radius_m_ = 0;
  float min_cos_incidence_ = 0;  // of directions to camera and laser
  const LightLimit* light_ = nullptr;
  const LightMap* light_map_ = nullptr;
  std::optional<double> laser_distance_m_;  // unset: that of the camera
  bool other_obstacles_ = false;            // obstacles besides the table travel with the stage
  std::optional<PlaceMeasurement> exact_;
};

}  // namespace sightline
