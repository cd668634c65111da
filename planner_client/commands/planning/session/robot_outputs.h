// SPDX-License-Identifier: Apache-2.0
// The robot of an inspection: its cell for a planning session, and its part of plans.
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

// Reads the robot, if the inspection has one; before anything is uploaded, since wrong input is
// found there.
absl::Status OpenRobotCell(const CoverageTask& task, PlanningSession* session);

// Scans that the robot cannot make become infeasible to the session's gain model, save `kept`. Says
// on stderr how much of the domain is reached. Nothing without a robot.
void AskRobotFirst(const std::vector<Measurement>& kept, PlanningSession* session);

// The gain model with scans that the robot cannot make infeasible, save `kept`. Only with a robot;
// the session's client must outlive it.
std::unique_ptr<GainModel> WithinReach(const PlanningSession& session,
                                       std::unique_ptr<GainModel> gain_model,
                                       const std::vector<Measurement>& kept);

// Moves in the best order; the scans' indices are those given. Only with a robot.
std::vector<RobotMove> OrderForRobot(const PlanningSession& session,
                                     const std::vector<ChosenScan>& scans, int locked);

// How the robot makes a scan, or why not and which scan near it can be made.
void DescribeMove(const PlanningSession& session, const RobotMove& move, v1::PlannedScan* scan);

// The robot as the report shows it. Only with a robot.
ReportRobot RobotForReport(const PlanningSession& session, const v1::Plan& plan);

}  // namespace sightline
