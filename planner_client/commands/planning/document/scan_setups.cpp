// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/planning/document/scan_setups.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/inspection/vector_proto.h"
#include "core/physics/angle.h"
#include "core/rig/scan_geometry.h"
#include "core/rig/sensor_bodies.h"
#include "planning/strategy/execution/execution_model.h"

namespace sightline {
namespace {

// Fraction of the measurable targets that a scan must add to be worth its set-up.
constexpr double kLittle = 0.005;

// The scan's geometry with the part at its nominal place.
ScanGeometry GeometryOf(const PlanningSession& session, const Measurement& measurement) {
  Rig rig = session.inspection.rig;
  rig.part_placement.reset();
  return MakeScanGeometry(rig, measurement);
}

// Index into the domain's resting orientations; -1: none of them.
int RestOf(const MeasurementDomain& domain, const Measurement& m) {
  constexpr double kSame_rad = 1e-6;
  for (size_t i = 0; i < domain.resting_orientations.size(); ++i) {
    const RestingOrientation& rest = domain.resting_orientations[i];
    const double off =
        std::max(std::abs(std::remainder(m.part_alpha_rad - rest.part_alpha_rad, 360 * kRadPerDeg)),
                 std::abs(std::remainder(m.part_beta_rad - rest.part_beta_rad, 360 * kRadPerDeg)));
    if (off <= kSame_rad) return static_cast<int>(i);
  }
  return -1;
}

v1::RestingFace FaceToProto(const RestingFace& face, double centre_height_m) {
  v1::RestingFace message;
  message.set_name(face.name);
  const auto degrees = [](double angle_rad) {
    return std::round(angle_rad / kRadPerDeg * 1e9) / 1e9;
  };
  message.set_part_alpha_deg(degrees(face.part_alpha_rad));
  message.set_part_beta_deg(degrees(face.part_beta_rad));
  *message.mutable_normal() = VectorToProto(face.normal);
  *message.mutable_centre_m() = VectorToProto(face.centre_m);
  message.set_area_m2(face.area_m2);
  message.set_stability_deg(degrees(face.stability_rad));
  message.set_centre_height_m(centre_height_m);
  return message;
}

v1::Pose PoseOf(const Eigen::Matrix4d& matrix) {
  v1::Pose pose;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) pose.add_matrix(matrix(row, column));
  }
  return pose;
}

v1::SensorPlace PlaceToProto(const PlanningSession& session, const ExecutionModel& execution,
                             const Measurement& scan) {
  const ScanGeometry geometry = GeometryOf(session, scan);
  v1::SensorPlace place;
  if (execution.robot_holds_head) {
    *place.mutable_camera_pose() = PoseOf(Eigen::Matrix4d::Identity());
    *place.mutable_laser_pose() =
        PoseOf(geometry.camera.Matrix().inverse() * geometry.laser.Matrix());
    return place;
  }
  *place.mutable_camera_pose() = PoseOf(geometry.camera.Matrix());
  *place.mutable_laser_pose() = PoseOf(geometry.laser.Matrix());
  if (!execution.stage_moves_in_height && !execution.robot_holds_part) {
    place.set_table_height_m(TableHeight(execution, scan));
  }
  return place;
}

// sensor_places and setups of the plan's scans in their order.
void AddSetupRuns(const PlanningSession& session, v1::Plan* plan) {
  const ExecutionModel execution = ExecutionModelOf(session.inspection);
  std::vector<Measurement> scans;
  for (const v1::PlannedScan& scan : plan->scans()) {
    scans.push_back(MeasurementFromProto(scan.measurement()));
  }
  for (const SetupRun& run : SetupsOf(execution, scans)) {
    if (run.place == static_cast<size_t>(plan->sensor_places_size())) {
      *plan->add_sensor_places() = PlaceToProto(session, execution, scans[run.begin]);
    }
    v1::Setup& setup = *plan->add_setups();
    setup.set_sensor_place(static_cast<int>(run.place));
    const v1::PlannedScan& first = plan->scans(static_cast<int>(run.begin));
    if (first.has_resting_face()) setup.set_resting_face(first.resting_face());
    v1::SetupTime& time = *setup.mutable_time_s();
    for (size_t i = run.begin; i < run.end; ++i) {
      const v1::PlannedScan& scan = plan->scans(static_cast<int>(i));
      setup.add_scans(scan.index());
      const ChangeTimes change =
          i > 0 ? TimesBetween(execution, scans[i - 1], scans[i]) : TimesBeforeFirst(execution);
      time.set_scan(time.scan() + scan.scan_time_s());
      // Repositioning by speeds concerns part and sensors alike; it is counted as turning.
      time.set_turn(time.turn() + change.turn_s + change.reposition_s);
      time.set_lay(time.lay() + change.lay_s);
      time.set_move_sensors(time.move_sensors() + change.move_sensors_s);
    }
    time.set_total(time.scan() + time.turn() + time.lay() + time.move_sensors());
  }
}

// Lists parameters outside the inspection's limits; empty: none.
std::string OutsideDomain(const MeasurementDomain& domain, const Measurement& measurement) {
  const auto values = ToArray(measurement);
  std::string outside;
  for (int p = 0; p < kMeasurementParameters; ++p) {
    if (!domain.resting_orientations.empty() && (p == kPartAlpha || p == kPartBeta)) continue;
    if (domain.parameters[p].Contains(values[p])) continue;
    const bool angle = p >= 1 && p <= 6;
    absl::StrAppendFormat(&outside, "%s%s is %.6g", outside.empty() ? "" : ", ",
                          kMeasurementParameterNames[p],
                          angle ? values[p] / kRadPerDeg : values[p]);
  }
  return outside;
}

}  // namespace

namespace {

// resting_faces, and resting_face and table_height_m of the scans.
void AddRestingFaces(const PlanningSession& session, v1::Plan* plan) {
  const std::vector<RestingFace>& faces = session.held.faces;
  if (faces.empty()) return;
  std::vector<int> listed(faces.size(), -1);
  std::vector<int> rest_of;
  for (const v1::PlannedScan& scan : plan->scans()) {
    rest_of.push_back(RestOf(session.inspection.domain, MeasurementFromProto(scan.measurement())));
    if (rest_of.back() >= 0) listed[static_cast<size_t>(rest_of.back())] = 0;
  }
  for (size_t f = 0; f < faces.size(); ++f) {
    if (listed[f] < 0) continue;
    listed[f] = plan->resting_faces_size();
    Measurement m;
    m.part_alpha_rad = faces[f].part_alpha_rad;
    m.part_beta_rad = faces[f].part_beta_rad;
    *plan->add_resting_faces() = FaceToProto(faces[f], -GeometryOf(session, m).table_height_m);
  }
  for (int i = 0; i < plan->scans_size(); ++i) {
    v1::PlannedScan& scan = *plan->mutable_scans(i);
    const ScanGeometry geometry = GeometryOf(session, MeasurementFromProto(scan.measurement()));
    scan.set_table_height_m(geometry.part_offset_m.z() + geometry.table_height_m);
    if (rest_of[i] >= 0) scan.set_resting_face(listed[static_cast<size_t>(rest_of[i])]);
  }
}

}  // namespace

void AddSetups(const PlanningSession& session, v1::Plan* plan) {
  AddRestingFaces(session, plan);
  for (const ExcludedRest& excluded : session.held.excluded) {
    v1::ExcludedFace& message = *plan->add_excluded_faces();
    Measurement m;
    m.part_alpha_rad = excluded.face.part_alpha_rad;
    m.part_beta_rad = excluded.face.part_beta_rad;
    *message.mutable_face() = FaceToProto(excluded.face, -GeometryOf(session, m).table_height_m);
    message.set_because(excluded.because);
    message.set_obstacle(excluded.obstacle);
  }
  AddSetupRuns(session, plan);
}

void AddRemarks(const PlanningSession& session, const std::vector<ChosenScan>& scans, bool given,
                v1::Plan* plan) {
  const MeasurementDomain& domain = session.inspection.domain;
  const auto measurable = static_cast<double>(plan->coverage().measurable_targets());
  for (int i = 0; i < plan->scans_size(); ++i) {
    v1::PlannedScan& scan = *plan->mutable_scans(i);
    const ChosenScan& chosen = scans[static_cast<size_t>(i)];
    if (!domain.resting_orientations.empty() && RestOf(domain, chosen.measurement) < 0) {
      scan.add_remarks(absl::StrFormat(
          "the part lies on none of its resting faces (alpha %.6g deg, beta %.6g deg)",
          chosen.measurement.part_alpha_rad / kRadPerDeg,
          chosen.measurement.part_beta_rad / kRadPerDeg));
    }
    if (const std::string outside = OutsideDomain(domain, chosen.measurement); !outside.empty()) {
      scan.add_remarks(
          absl::StrCat("outside what the inspection's `measurement` allows: ", outside));
    }
    const Rig& rig = session.inspection.rig;
    const ScanGeometry geometry = GeometryOf(session, chosen.measurement);
    if (SensorBodiesCollide(rig, geometry)) {
      scan.add_remarks(
          absl::StrFormat("the bodies of camera and laser overlap by %.3g mm "
                          "(rig.camera_bodies, rig.laser_bodies)",
                          1e3 * SensorBodyOverlap(rig, geometry)));
    }
    switch (chosen.exact.feasibility) {
      case ScanFeasibility::kFeasible:
        break;
      case ScanFeasibility::kCollision:
        scan.add_remarks("camera, laser or part would collide: the scan does not count");
        continue;
      case ScanFeasibility::kTravel:
        scan.add_remarks(
            "needs more stage travel than rig.stage_travel_m: the scan does not count");
        continue;
      case ScanFeasibility::kOutOfBounds:
        scan.add_remarks("is out of bounds: the scan does not count");
        continue;
      case ScanFeasibility::kUnreachable:
        continue;  // the robot's move says why
    }
    if (!given && !chosen.locked) continue;
    if (session.ForUncertainty()) continue;
    if (scan.covered_targets() == 0) {
      scan.add_remarks("measures no target");
    } else if (static_cast<double>(scan.new_targets()) < kLittle * measurable) {
      scan.add_remarks(
          absl::StrFormat("adds little: %d of its %d targets are measured by no scan before it",
                          scan.new_targets(), scan.covered_targets()));
    }
  }
}

}  // namespace sightline
