// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/planning/document/placement_outputs.h"

#include <vector>

#include "absl/strings/str_format.h"
#include "core/field_limits/field_checks.h"
#include "core/status/status_macros.h"
#include "planner_client/command_line/process/interrupt.h"
#include "planning/placement/placement_coverage.h"

namespace sightline {

absl::Status AddPlacementCoverage(const PlanningSession& session, PlanDocument* document) {
  const PlacementErrors& errors = session.inspection.placement;
  if (errors.AreZero() || session.measured != nullptr || document->scans.empty() ||
      InterruptFlag()) {
    return absl::OkStatus();
  }
  std::vector<Measurement> scans;
  for (const ChosenScan& scan : document->scans) scans.push_back(scan.measurement);
  SIGHTLINE_ASSIGN_OR_RETURN(
      const auto coverage, PlacementCoverage(PlacementModelOf(session.inspection), scans,
                                             session.client->measurable().Count(),
                                             [&](std::span<const Measurement> measurements,
                                                 std::span<const ScanDisplacement> displacements) {
                                               return session.client->DisplacedCoverage(
                                                   measurements, displacements);
                                             }));
  document->plan.mutable_coverage()->set_placement_p5(coverage);
  v1::Placement& placement = *document->plan.mutable_placement();
  placement.set_part_position_m(errors.part_position_m);
  placement.set_part_angle_deg(Degrees(errors.part_angle_rad));
  placement.set_sensor_position_m(errors.sensor_position_m);
  placement.set_sensor_angle_deg(Degrees(errors.sensor_angle_rad));
  return absl::OkStatus();
}

std::string SummarisePlacement(const v1::Plan& plan) {
  if (!plan.coverage().has_placement_p5()) return "";
  const v1::Placement& p = plan.placement();
  return absl::StrFormat(
      "placed with errors, 95 of 100 executions measure more than %.2f %%: part %.3g mm and %.3g "
      "deg, sensors %.3g mm and %.3g deg (standard deviations).\n",
      100 * plan.coverage().placement_p5(), 1e3 * p.part_position_m(), p.part_angle_deg(),
      1e3 * p.sensor_position_m(), p.sensor_angle_deg());
}

}  // namespace sightline
