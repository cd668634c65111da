// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/planning/session/robot_outputs.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/random/random.h"
#include "core/status/status_macros.h"
#include "planner_client/command_line/process/interrupt.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/gain_model/reachable_gain_model.h"
#include "planning/optimise/search_space.h"
#include "planning/robot/nearest_reachable.h"
#include "planning/strategy/scan_order.h"

namespace sightline {
namespace {

Eigen::Vector3d CentreOf(const PlanningSession& session) {
  const auto& placement = session.inspection.rig.part_placement;
  return placement ? placement->centre_m : session.part->BoundingBox().center();
}

ScanTravel ExpectedTravel(const PlanningSession& session, const Measurement& measurement) {
  return EstimateTravel(session.inspection.rig, session.client->targets(),
                        session.inspection.targets.spacing_m, CentreOf(session), measurement);
}

// Prints the reachable fraction of scans spread over the domain, and the most frequent obstacle.
void PrintReach(const PlanningSession& session) {
  constexpr int kTried = 200;
  const SearchSpace space(session.inspection.domain);
  Random random(1);
  std::map<std::string, int> reasons;
  int reached = 0, tried = 0;
  for (; tried < kTried && !InterruptFlag(); ++tried) {
    std::vector<double> unit(static_cast<size_t>(space.dimension()));
    for (double& x : unit) x = random.Uniform();
    const Measurement scan = space.ToMeasurement(unit);
    const Reach reach = session.robot->Reachable(scan, ExpectedTravel(session, scan), false);
    if (reach.reachable()) {
      ++reached;
    } else {
      // Without the numbers, which differ from scan to scan.
      const std::string& text = reach.because;
      const size_t end = text.starts_with("collision") ? text.find(',')
                         : text.starts_with("joint")   ? text.find(" would")
                                                       : text.find(':');
      ++reasons[text.substr(0, end)];
    }
  }
  std::string most;
  int count = 0;
  for (const auto& [reason, times] : reasons) {
    if (times > count) {
      count = times;
      most = reason;
    }
  }
  PrintTextTo(stderr, "robot: %s reaches %d of %d scans spread over the domain%s\n",
              session.robot->model().name.c_str(), reached, tried,
              count == 0 ? "" : absl::StrCat("; most others: ", most).c_str());
}

ReportSolid SolidForReport(const Shape& shape) {
  // Limit for a page; finer meshes lose some triangles.
  constexpr size_t kMostTriangles = 20000;
  ReportSolid solid;
  if (const auto* box = std::get_if<BoxShape>(&shape.solid)) {
    solid.box_m = box->size_m;
  } else if (const auto* cylinder = std::get_if<CylinderShape>(&shape.solid)) {
    solid.radius_m = cylinder->radius_m;
    solid.length_m = cylinder->length_m;
  } else if (const auto* sphere = std::get_if<SphereShape>(&shape.solid)) {
    solid.radius_m = sphere->radius_m;
  } else {
    const TriangleMesh& mesh = *std::get<MeshShape>(shape.solid);
    const size_t stride = mesh.triangles.size() / kMostTriangles + 1;
    for (size_t t = 0; t < mesh.triangles.size(); t += stride) {
      const auto& [a, b, c] = mesh.triangles[t];
      solid.triangles_m.push_back({mesh.positions_m[a], mesh.positions_m[b], mesh.positions_m[c]});
    }
  }
  return solid;
}

}  // namespace

absl::Status OpenRobotCell(const CoverageTask& task, PlanningSession* session) {
  const Inspection& inspection = session->inspection;
  if (!inspection.robot) return absl::OkStatus();
  CellTask cell;
  cell.mount = *inspection.robot;
  cell.rig = inspection.rig;
  cell.head = SearchSpace(inspection.domain)
                  .ToMeasurement(std::vector<double>(
                      static_cast<size_t>(SearchSpace(inspection.domain).dimension()), 0.5));
  cell.part = session->part;
  cell.part_centre_m = CentreOf(*session);
  for (const auto& obstacle : task.obstacles) {
    cell.obstacles.push_back({obstacle.name, obstacle.mesh, obstacle.frame});
  }
  SIGHTLINE_ASSIGN_OR_RETURN(session->robot, RobotCell::Make(std::move(cell)));
  return absl::OkStatus();
}

std::unique_ptr<GainModel> WithinReach(const PlanningSession& session,
                                       std::unique_ptr<GainModel> gain_model,
                                       const std::vector<Measurement>& kept) {
  const Rig rig = session.inspection.rig;
  const TargetSet* targets = &session.client->targets();  // of the session's client, which stays
  const double spacing_m = session.inspection.targets.spacing_m;
  const Eigen::Vector3d centre_m = CentreOf(session);
  auto within = std::make_unique<ReachableGainModel>(
      std::move(gain_model), session.robot,
      [=](const Measurement& measurement) {
        return EstimateTravel(rig, *targets, spacing_m, centre_m, measurement);
      },
      rig.scan_step_m);
  within->Keep(kept);
  return within;
}

void AskRobotFirst(const std::vector<Measurement>& kept, PlanningSession* session) {
  if (!session->robot) return;
  for (const std::string& remark : session->robot->model().remarks) {
    PrintTextTo(stderr, "robot: %s\n", remark.c_str());
  }
  PrintReach(*session);
  session->gain_model = WithinReach(*session, std::move(session->gain_model), kept);
}

std::vector<RobotMove> OrderForRobot(const PlanningSession& session,
                                     const std::vector<ChosenScan>& scans, int locked) {
  std::vector<ScanToReach> to_reach;
  for (const ChosenScan& scan : scans) {
    const double step_m = session.inspection.rig.scan_step_m;
    const bool measures = scan.exact.last_frame >= scan.exact.first_frame;
    to_reach.push_back({scan.measurement, measures ? ScanTravel{scan.exact.first_frame * step_m,
                                                                scan.exact.last_frame * step_m}
                                                   : ExpectedTravel(session, scan.measurement)});
  }
  const ExecutionModel execution = ExecutionModelOf(session.inspection);
  return SequenceScans(
      *session.robot, to_reach, locked,
      [&](int from, int to) {
        return RepositionTimeS(execution, scans[static_cast<size_t>(from)].measurement,
                               scans[static_cast<size_t>(to)].measurement);
      },
      &InterruptFlag());
}

void DescribeMove(const PlanningSession& session, const RobotMove& move, v1::PlannedScan* scan) {
  v1::RobotScan& robot = *scan->mutable_robot();
  robot.set_reachable(move.reachable);
  if (!move.remark.empty()) scan->add_remarks(move.remark);
  if (move.reachable) {
    for (const double q : move.position.start) robot.add_start_position(q);
    for (const double q : move.position.end) robot.add_end_position(q);
    robot.set_move_time_s(move.move_time_s);
    return;
  }
  robot.set_because(move.because);
  const Measurement measurement = MeasurementFromProto(scan->measurement());
  const auto nearest = NearestReachable(
      *session.robot, session.inspection.domain, measurement,
      [&](const Measurement& near) { return ExpectedTravel(session, near); }, &InterruptFlag());
  scan->add_remarks(absl::StrCat("the robot cannot make this scan (", move.because, "); ",
                                 nearest ? absl::StrCat("the nearest reachable scan found has ",
                                                        DifferenceText(*nearest, measurement))
                                 : InterruptFlag() ? "scans near it were not tried"
                                                   : "no reachable scan was found near it"));
}

ReportRobot RobotForReport(const PlanningSession& session, const v1::Plan& plan) {
  const RobotModel& model = session.robot->model();
  ReportRobot report;
  report.name = model.name;
  for (const RobotJoint& joint : model.joints) report.joints.push_back({joint.name, joint.rotary});
  std::vector<std::pair<size_t, Eigen::Isometry3d>> place;  // link of every solid, pose there
  for (size_t link = 0; link < model.links.size(); ++link) {
    for (const Shape& shape : model.links[link].shapes) {
      place.emplace_back(link, shape.pose);
      report.solids.push_back(SolidForReport(shape));
    }
  }
  const auto poses_at = [&](const v1::PlannedScan& scan, double stage_m, const auto& position) {
    const JointPositions q(position.begin(), position.end());
    const auto links =
        session.robot->LinksInPart(MeasurementFromProto(scan.measurement()), stage_m, q);
    std::vector<Eigen::Isometry3d> poses;
    for (const auto& [link, pose] : place) poses.push_back(links[link] * pose);
    return poses;
  };
  for (const v1::PlannedScan& scan : plan.scans()) {
    ReportRobot::ScanPoses& poses = report.scans.emplace_back();
    if (!scan.robot().reachable()) continue;
    poses.start = poses_at(scan, scan.stage_start_m(), scan.robot().start_position());
    poses.end = poses_at(scan, scan.stage_end_m(), scan.robot().end_position());
  }
  return report;
}

}  // namespace sightline
