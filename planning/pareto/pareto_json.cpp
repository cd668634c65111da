// SPDX-License-Identifier: Apache-2.0
#include "planning/pareto/pareto_json.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"
#include "planning/plan_file/part_of_plan.h"

namespace sightline {
namespace {

v1::CostModel CostsToProto(const CostModel& costs) {
  v1::CostModel message;
  if (costs.stage_speed_m_per_s) message.set_stage_speed_m_per_s(*costs.stage_speed_m_per_s);
  if (costs.frame_rate_hz) message.set_frame_rate_hz(*costs.frame_rate_hz);
  if (costs.reposition_time_s) message.set_reposition_time_s(*costs.reposition_time_s);
  if (costs.reposition_speed_rad_per_s) {
    // Rounded to the stated value: 30, not 29.999999999999996.
    const double deg_per_s = *costs.reposition_speed_rad_per_s * 180 / std::numbers::pi;
    message.set_reposition_speed_deg_per_s(std::round(1e9 * deg_per_s) / 1e9);
  }
  if (costs.reposition_speed_m_per_s) {
    message.set_reposition_speed_m_per_s(*costs.reposition_speed_m_per_s);
  }
  if (costs.lay_time_s > 0) message.set_lay_time_s(costs.lay_time_s);
  if (costs.turn_time_s > 0) message.set_turn_time_s(costs.turn_time_s);
  if (costs.move_sensors_time_s > 0) message.set_move_sensors_time_s(costs.move_sensors_time_s);
  return message;
}

v1::ParetoPoint PointToProto(const ParetoPoint& point, int number, bool with_measurements) {
  v1::ParetoPoint message;
  message.set_number(number);
  message.set_scans(static_cast<int>(point.scans.size()));
  message.set_time_s(point.time.Total_s());
  message.set_scan_time_s(point.time.scan_s);
  message.set_frame_rate_time_s(point.time.frame_rate_s);
  message.set_reposition_time_s(point.time.reposition_s);
  message.set_settled(static_cast<double>(point.Claimed()) /
                      static_cast<double>(std::max<int64_t>(1, point.score.measurable)));
  message.set_settled_targets(point.score.satisfied);
  if (point.score.validation_satisfied)
    message.set_fresh_settled_targets(*point.score.validation_satisfied);
  message.set_reaches_goal(point.reaches_goal);
  if (!with_measurements) return message;
  int locked = 0;
  for (const ChosenScan& scan : point.scans) {
    *message.add_measurements() = MeasurementToProto(scan.measurement);
    locked += scan.locked ? 1 : 0;
  }
  message.set_locked_scans(locked);
  return message;
}

absl::Status Differs(const std::string& path, const std::string& field, const std::string& value,
                     const std::string& expected) {
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": ", field, " is ", value, ", must be ", expected));
}

std::string Quoted(const std::string& text) { return absl::StrCat("\"", text, "\""); }

bool Near(double a, double b) {
  return std::abs(a - b) <= 1e-9 * std::max({1.0, std::abs(a), std::abs(b)});
}

absl::Status CheckCosts(const v1::CostModel& costs, const CostModel& expected,
                        const std::string& path) {
  const v1::CostModel wanted = CostsToProto(expected);
  const auto check = [&](const char* name, bool has, double value, bool wants,
                         double wanted_value) {
    if (has == wants && (!has || Near(value, wanted_value))) return absl::OkStatus();
    const auto text = [](bool given, double number) {
      return given ? NumberText(number) : std::string("not given");
    };
    return Differs(path, absl::StrCat("costs.", name), text(has, value),
                   text(wants, wanted_value) + " as in the inspection");
  };
  absl::Status status =
      check("stage_speed_m_per_s", costs.has_stage_speed_m_per_s(), costs.stage_speed_m_per_s(),
            wanted.has_stage_speed_m_per_s(), wanted.stage_speed_m_per_s());
  status.Update(check("frame_rate_hz", costs.has_frame_rate_hz(), costs.frame_rate_hz(),
                      wanted.has_frame_rate_hz(), wanted.frame_rate_hz()));
  status.Update(check("reposition_time_s", costs.has_reposition_time_s(), costs.reposition_time_s(),
                      wanted.has_reposition_time_s(), wanted.reposition_time_s()));
  status.Update(check("reposition_speed_deg_per_s", costs.has_reposition_speed_deg_per_s(),
                      costs.reposition_speed_deg_per_s(), wanted.has_reposition_speed_deg_per_s(),
                      wanted.reposition_speed_deg_per_s()));
  status.Update(check("reposition_speed_m_per_s", costs.has_reposition_speed_m_per_s(),
                      costs.reposition_speed_m_per_s(), wanted.has_reposition_speed_m_per_s(),
                      wanted.reposition_speed_m_per_s()));
  status.Update(check("lay_time_s", costs.has_lay_time_s(), costs.lay_time_s(),
                      wanted.has_lay_time_s(), wanted.lay_time_s()));
  status.Update(check("turn_time_s", costs.has_turn_time_s(), costs.turn_time_s(),
                      wanted.has_turn_time_s(), wanted.turn_time_s()));
  status.Update(check("move_sensors_time_s", costs.has_move_sensors_time_s(),
                      costs.move_sensors_time_s(), wanted.has_move_sensors_time_s(),
                      wanted.move_sensors_time_s()));
  return status;
}

// Same limit as goal.max_scans.
constexpr int kMostScans = 1000;

absl::Status CheckPoint(const v1::ParetoPoint& point, int index, const ParetoTask& task,
                        const std::string& path) {
  const std::string name = absl::StrCat("points[", index, "]");
  if (point.number() != index + 1) {
    return Differs(path, name + ".number", absl::StrCat(point.number()), absl::StrCat(index + 1));
  }
  if (point.scans() < 1 || point.scans() > kMostScans ||
      point.scans() != point.measurements_size()) {
    return Differs(path, name + ".scans", absl::StrCat(point.scans()),
                   absl::StrCat("the number of its measurements, which is ",
                                point.measurements_size(), ", and in [1, ", kMostScans, "]"));
  }
  if (point.locked_scans() < 0 || point.locked_scans() > point.scans()) {
    return Differs(path, name + ".locked_scans", absl::StrCat(point.locked_scans()),
                   absl::StrCat("in [0, ", point.scans(), "]"));
  }
  if (!(point.settled() >= 0 && point.settled() <= 1)) {
    return Differs(path, name + ".settled", NumberText(point.settled()), "in [0, 1]");
  }
  if (!(point.time_s() >= 0) || !std::isfinite(point.time_s())) {
    return Differs(path, name + ".time_s", NumberText(point.time_s()), "at least 0");
  }
  for (int i = point.locked_scans(); i < point.measurements_size(); ++i) {
    const Measurement measurement = MeasurementFromProto(point.measurements(i));
    if (task.domain.Contains(measurement)) continue;
    const std::string scan = absl::StrCat(name, ".measurements[", i, "]");
    const auto values = ToArray(measurement);
    for (int p = 0; p < kMeasurementParameters; ++p) {
      const bool resting =
          !task.domain.resting_orientations.empty() && (p == kPartAlpha || p == kPartBeta);
      if (resting || task.domain.parameters[p].Contains(values[p])) continue;
      const bool angle = p >= 1 && p <= 6;
      return Differs(
          path, absl::StrCat(scan, ".", kMeasurementParameterNames[p]),
          NumberText(angle ? values[p] * 180 / std::numbers::pi : values[p]),
          absl::StrCat("in the inspection's measurement.", kMeasurementParameterNames[p]));
    }
    return Differs(path, scan, "of another orientation",
                   "one of the inspection's measurement.resting_orientations");
  }
  return absl::OkStatus();
}

}  // namespace

v1::ParetoFront ParetoToProto(const ParetoResult& result, const ParetoTask& task, int64_t seed,
                              size_t chosen, v1::Plan::StopReason stop_reason) {
  v1::ParetoFront message;
  message.set_inspection_name(task.inspection_name);
  message.set_sightline_version(task.sightline_version);
  message.set_seed(seed);
  message.set_part_digest(task.part_digest.Text());
  message.set_scene_digest(task.scene_digest);
  if (!task.costs.IsUnit()) *message.mutable_costs() = CostsToProto(task.costs);
  message.set_for_uncertainty(task.for_uncertainty);
  message.set_goal(task.goal);
  message.set_judged_targets(task.judged_targets);
  message.set_fresh_judged_targets(task.fresh_judged_targets);
  int number = 0;
  for (const ParetoPoint& point : result.front.points) {
    *message.add_points() = PointToProto(point, ++number, true);
  }
  for (const ParetoPoint& point : result.front.dominated) {
    *message.add_dominated() = PointToProto(point, 0, false);
  }
  message.set_chosen(static_cast<int>(chosen) + 1);
  message.set_gain_evaluations(result.evaluations);
  message.set_stop_reason(stop_reason);
  return message;
}

absl::Status CheckPareto(const v1::ParetoFront& front, const ParetoTask& task,
                         const std::string& path, std::string* remark) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto other_rule,
                             CheckPlanBelongsToPart(path, front.part_digest(), task.part_digest,
                                                    task.part_file, OtherPart::kRefused));
  if (remark != nullptr) *remark = other_rule;
  // The digest of a scene contains that of its part.
  if (other_rule.empty() && front.scene_digest() != task.scene_digest) {
    return Differs(
        path, "scene_digest", Quoted(front.scene_digest()),
        Quoted(task.scene_digest) +
            ": the front is of another inspection (rig, targets, obstacles) or was made with "
            "other --field-directions");
  }
  SIGHTLINE_RETURN_IF_ERROR(CheckCosts(front.costs(), task.costs, path));
  if (front.for_uncertainty() != task.for_uncertainty) {
    return Differs(path, "for_uncertainty", front.for_uncertainty() ? "true" : "false",
                   task.for_uncertainty ? "true: the inspection's goal is goal.admissible"
                                        : "false: the inspection's goal is goal.coverage");
  }
  if (front.judged_targets() != task.judged_targets) {
    return Differs(
        path, "judged_targets", absl::StrCat(front.judged_targets()),
        absl::StrCat(task.judged_targets, ": the front is of another inspection (tolerances)"));
  }
  if (!(front.goal() > 0 && front.goal() <= 1)) {
    return Differs(path, "goal", NumberText(front.goal()), "in (0, 1]");
  }
  if (front.points_size() == 0) return Differs(path, "points", "empty", "at least one point");
  for (int i = 0; i < front.points_size(); ++i) {
    SIGHTLINE_RETURN_IF_ERROR(CheckPoint(front.points(i), i, task, path));
  }
  return absl::OkStatus();
}

std::vector<Measurement> ScansOfPoint(const v1::ParetoPoint& point) {
  std::vector<Measurement> scans;
  for (const v1::Measurement& measurement : point.measurements()) {
    scans.push_back(MeasurementFromProto(measurement));
  }
  return scans;
}

absl::StatusOr<int> PickPoint(const v1::ParetoFront& front, const ParetoPick& pick,
                              const std::string& path) {
  if (front.points_size() == 0) return Differs(path, "points", "empty", "at least one point");
  if (pick.number) {
    if (*pick.number >= 1 && *pick.number <= front.points_size()) return *pick.number - 1;
    return absl::OutOfRangeError(absl::StrCat("--pick ", *pick.number, ": ", path,
                                              " has points 1 to ", front.points_size()));
  }
  if (pick.seconds && !front.has_costs()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--pick-seconds: ", path,
        " has no seconds, since the inspection has no `costs`; use --pick or --pick-scans"));
  }
  int best = -1, least_scans = front.points(0).scans();
  double least_s = front.points(0).time_s();
  for (int i = 0; i < front.points_size(); ++i) {
    const v1::ParetoPoint& point = front.points(i);
    least_scans = std::min(least_scans, point.scans());
    least_s = std::min(least_s, point.time_s());
    if (pick.scans && point.scans() > *pick.scans) continue;
    if (pick.seconds && point.time_s() > *pick.seconds) continue;
    // Points are sorted by scans, then seconds: among equally satisfied ones the first has least.
    if (best < 0 || point.settled() > front.points(best).settled()) best = i;
  }
  if (best >= 0) return best;
  if (pick.scans) {
    return absl::OutOfRangeError(absl::StrCat("--pick-scans ", *pick.scans, ": the least of ", path,
                                              " is ", least_scans,
                                              least_scans == 1 ? " scan" : " scans"));
  }
  return absl::OutOfRangeError(
      absl::StrFormat("--pick-seconds %s: the quickest plan of %s takes %.2f s",
                      NumberText(pick.seconds.value_or(0)), path, least_s));
}

absl::Status CheckSameNumbers(const v1::ParetoPoint& point, const PlanScore& score,
                              const PlanTime& time, const std::string& path) {
  const std::string name = absl::StrCat("points[", point.number() - 1, "]");
  const std::string again =
      " by exact evaluation of its scans: the file was changed, or made with "
      "another inspection or version; plan again with --pareto";
  if (point.settled_targets() != score.satisfied) {
    return Differs(path, name + ".settled_targets", absl::StrCat(point.settled_targets()),
                   absl::StrCat(score.satisfied, again));
  }
  if (point.has_fresh_settled_targets() && score.validation_satisfied &&
      point.fresh_settled_targets() != *score.validation_satisfied) {
    return Differs(path, name + ".fresh_settled_targets",
                   absl::StrCat(point.fresh_settled_targets()),
                   absl::StrCat(*score.validation_satisfied, again));
  }
  if (!Near(point.time_s(), time.Total_s())) {
    return Differs(path, name + ".time_s", NumberText(point.time_s()),
                   NumberText(time.Total_s()) + again);
  }
  return absl::OkStatus();
}

std::string SummarisePareto(const v1::ParetoFront& front) {
  const bool seconds = front.has_costs();
  std::string text = absl::StrFormat("Pareto front, %d points:\n   no. scans %s%s\n",
                                     front.points_size(), seconds ? "  seconds " : "",
                                     front.for_uncertainty() ? "admissible" : "covered");
  for (const v1::ParetoPoint& point : front.points()) {
    absl::StrAppendFormat(&text, "%c %4d %5d ", point.number() == front.chosen() ? '*' : ' ',
                          point.number(), point.scans());
    if (seconds) absl::StrAppendFormat(&text, "%9.1f ", point.time_s());
    absl::StrAppendFormat(&text, "%7.2f %%%s\n", 100 * point.settled(),
                          point.reaches_goal() ? " goal" : "");
  }
  absl::StrAppend(&text, seconds ? "" : "The inspection has no costs: every scan counts 1.\n",
                  "* is the plan written; --pick NUMBER takes another.\n");
  return text;
}

}  // namespace sightline
