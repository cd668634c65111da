// SPDX-License-Identifier: Apache-2.0
// The robot of an inspection: its cell in a planning session, and its fields in plans.
#pragma once

#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "planner_client/commands/planning/session/planning_session.h"
#include "planning/robot/robot_moves.h"
#include "planning/strategy/planner.h"
#include "report/plan/sections/robot_section.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// Reads the robot, if the inspection has one. This happens before any upload, since it finds wrong
// input.
absl::Status OpenRobotCell(const CoverageTask& task, PlanningSession* session);

// Makes scans that the robot cannot make infeasible in the session's gain model, except `kept`.
// Prints on stderr which fraction of the domain is reached. Does nothing without a robot.
void AskRobotFirst(const std::vector<Measurement>& kept, PlanningSession* session);

// A gain model in which scans that the robot cannot make are infeasible, except `kept`. Requires a
// robot; the session's client must outlive the result.
std::unique_ptr<GainModel> WithinReach(const PlanningSession& session,
                                       std::unique_ptr<GainModel> gain_model,
                                       const std::vector<Measurement>& kept);

// Moves in the best order; their scan indices refer to the given scans. Requires a robot.
std::vector<RobotMove> OrderForRobot(const PlanningSession& session,
                                     const std::vector<ChosenScan>& scans, int locked);

// Describes how the robot makes a scan, or why it cannot, with the nearest scan that it can make.
void DescribeMove(const PlanningSession& session, const RobotMove& move, v1::PlannedScan* scan);

// The robot for the report. Requires a robot.
ReportRobot RobotForReport(const PlanningSession& session, const v1::Plan& plan);

}  // namespace sightline
