// SPDX-License-Identifier: Apache-2.0
// Finds the targets that a rig with its table can measure, among those measurable in free space.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/rig/rig.h"
#include "core/targets/target_set.h"
#include "coverage_server/collision/collision.h"
#include "coverage_server/visibility/visibility_field.h"

namespace sightline {

// A target counts as measurable in a domain if in one of the orientations in which the part may lie
// camera and laser can stand so that
//  - both directions are open as MarkMeasurable has it (segments decide, in the directions of a map
//    twice as fine as the field's) and on the near side of the surface;
//  - polar angle of the camera and triangulation angle are of the domain, to 2 degrees; the target
//  may
//    be anywhere in the image, so the line of sight differs from the optical axis by up to half the
//    field of view;
//  - some camera distance of the domain meets the limits on footprint, depth per pixel and defocus,
//    and leaves room for the bodies of both sensors;
//  - sensors and their bodies are above the table, or the line of sight passes beside it;
//  - no other obstacle that travels with the stage hides it (turns about the vertical in steps of
//  30
//    degrees).
// Where alpha and beta are free any orientation is assumed. Not asked: offsets, travel of the
// stage, collision with anything but the table, and obstacles that stand still: a target is
// measurable if the conditions above allow it.
class DomainMeasurability {
 public:
  // `part_centre_m`: reference point of offsets. `field` and `occluders` must outlive it.
  DomainMeasurability(const Rig& rig, const TargetSampling& sampling,
                      const MeasurementDomain& domain, const Eigen::Vector3d& part_centre_m,
                      const VisibilityField& field, const std::vector<Occluder>& occluders);

  // Least and largest angle between camera and laser that domain and limits leave; least above
  // largest: none.
  double min_angle_rad() const { return min_angle_rad_; }
  double max_angle_rad() const { return max_angle_rad_; }
  // No resting orientation nor a bounded alpha or beta: Keep changes nothing.
  bool any_orientation() const { return rests_.empty(); }

  // Clears the bits of [begin, end) that are set in `measurable` and cannot be measured. Stops
  // early when *cancelled.
  void Keep(const TargetSet& targets, size_t begin, size_t end, const std::atomic<bool>* cancelled,
            TargetBits& measurable) const;

 private:
  // Directions of one half plane through the vertical, tilted along the laser line, at polar angles
  // kFirstPolar_deg + i kStep_deg. Cells are of the field's map and of the finer one.
  static constexpr int kPolars = 64;
  struct Arc {
    uint16_t cell[kPolars];
    uint16_t fine_cell[kPolars];
    float azimuth_rad;
  };
  struct Rest {
    Eigen::Matrix3f rotation;  // part to world, gamma = 0
    float table_height_m;      // over the part's centre
    std::vector<Arc> arcs;
  };
  struct TargetState;

  void AddRest(const Rig& rig, double alpha_rad, double beta_rad,
               const std::vector<double>& azimuths_rad);
  // Sets allowed_lasers_ and the angles.
  void AllowPairs(const Rig& rig, const TargetSampling& sampling, const MeasurementDomain& domain);
  bool MeasurableAt(const Rest& rest, TargetState& state) const;
  bool FreeOfObstacles(const Rest& rest, const Eigen::Vector3f& place, float azimuth_rad,
                       const Eigen::Vector3f& to_camera, const Eigen::Vector3f& to_laser) const;

  const VisibilityField& field_;
  const std::vector<Occluder>& occluders_;
  Eigen::Vector3f part_centre_m_;
  OctahedralMap fine_;
  std::vector<Eigen::Vector3f> fine_directions_;
  std::vector<Rest> rests_;
  // Bit l of entry c: camera at polar angle c, laser at l.
  uint64_t allowed_lasers_[kPolars] = {};
  uint64_t cameras_ = 0, lasers_ = 0;  // that are in a pair
  double min_angle_rad_ = 0, max_angle_rad_ = 0;
  double tilt_rad_ = 0;
  float nearest_m_ = 0, farthest_m_ = 0;  // of the sensors from a target
  float drop_[2][kPolars] = {};           // lowest point of camera's and laser's bodies below it
  std::vector<double> turns_rad_;         // gamma that are tried against obstacles
  ParameterDomain azimuth_;
  // Radius of the table: circle within it about the part's centre; 0: none.
  float table_radius_m_ = 0;
  float min_cos_incidence_ = 0;          // of directions to camera and laser
  std::vector<const Occluder*> others_;  // that travel with the stage, but the table
};

}  // namespace sightline
