// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/planning/document/plan_document.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <set>
#include <system_error>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "core/rig/scan_geometry.h"
#include "core/status/status_macros.h"
#include "core/triangulation/triangulation.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/commands/planning/document/placement_outputs.h"
#include "planner_client/commands/planning/document/scan_setups.h"
#include "planner_client/commands/planning/document/set_up_outputs.h"
#include "planner_client/commands/planning/document/uncertainty_outputs.h"
#include "planner_client/commands/planning/document/uncovered_outputs.h"
#include "planner_client/commands/planning/session/robot_outputs.h"
#include "planner_client/gain_model/joined_uncertainty.h"
#include "planning/requirements/feature_verdicts.h"
#include "planning/requirements/joined_scans.h"
#include "planning/strategy/execution/execution_bound.h"
#include "planning/strategy/scan_order.h"
#include "report/uncertainty/inadmissible.h"
#include "report/uncertainty/uncertainty_report.h"

namespace sightline {
namespace {

v1::Pose ToPose(const Eigen::Matrix4d& matrix) {
  v1::Pose pose;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) pose.add_matrix(matrix(row, column));
  }
  return pose;
}

v1::PlannedScan DescribeScan(const PlanningSession& session, const ChosenScan& chosen) {
  // Poses for a part at its nominal place: the frame in which points are delivered.
  Rig rig = session.inspection.rig;
  rig.part_placement.reset();
  const Eigen::Vector3d centre = session.model_centre_m;
  const ScanGeometry geometry = MakeScanGeometry(rig, chosen.measurement);
  v1::PlannedScan scan;
  *scan.mutable_measurement() = MeasurementToProto(chosen.measurement);
  scan.set_locked(chosen.locked);
  const int first = chosen.exact.first_frame, last = chosen.exact.last_frame;
  const double start_m = last >= first ? first * rig.scan_step_m : 0;
  scan.set_stage_start_m(start_m);
  scan.set_stage_end_m(last >= first ? last * rig.scan_step_m : 0);
  for (int frame = first; frame <= last; ++frame)
    scan.add_trigger_positions_m(frame * rig.scan_step_m);
  *scan.mutable_camera_pose() =
      ToPose(WorldToPart(geometry, centre, geometry.camera, start_m).Matrix());
  *scan.mutable_laser_pose() =
      ToPose(WorldToPart(geometry, centre, geometry.laser, start_m).Matrix());
  Eigen::Matrix4d part = Eigen::Matrix4d::Identity();
  part.topLeftCorner<3, 3>() = geometry.part_rotation;
  part.topRightCorner<3, 1>() = geometry.part_offset_m - geometry.part_rotation * centre;
  *scan.mutable_part_pose() = ToPose(part);
  scan.set_fast_covered_targets(chosen.fast_covered);
  scan.set_measurement_points(chosen.exact.measurement_points);
  return scan;
}

// Verdicts about the toleranced features.
void AddVerdicts(const PlanningSession& session, const PlanKnowledge& knowledge,
                 v1::PlanUncertainty& message) {
  std::vector<v1::FeatureVerdict> verdicts =
      JudgeFeatures(session.inspection, *session.requirements, knowledge);
  *message.mutable_tolerances() = CountVerdicts(verdicts);
  for (v1::FeatureVerdict& verdict : verdicts) *message.add_features() = std::move(verdict);
}

// Quality of the registration of every set-up's scans.
void AddRegistration(const PlanningSession& session, const SharedErrors& errors,
                     const std::vector<int>& index_of, v1::Plan& plan) {
  v1::PlanUncertainty& message = *plan.mutable_uncertainty();
  message.set_registration(RegistrationStatement(session.inspection, errors));
  message.set_calibration(CalibrationStatement(session.inspection));
  if (session.inspection.uncertainty->registration == RegistrationMethod::kNone) return;
  for (v1::Setup& setup : *plan.mutable_setups()) {
    std::set<size_t> frames;
    for (size_t s = 0; s < index_of.size(); ++s) {
      const int number = plan.scans(index_of[s]).index();
      if (std::find(setup.scans().begin(), setup.scans().end(), number) != setup.scans().end()) {
        frames.insert(errors.frame_of(s));
      }
    }
    double squares_m2 = 0;
    int64_t targets = 0, overlap = 0;
    bool determined = true, joined = true;
    for (const size_t f : frames) {
      const FrameRegistration& frame = errors.frames()[f];
      squares_m2 += static_cast<double>(frame.targets) * frame.standard_uncertainty_m *
                    frame.standard_uncertainty_m;
      targets += frame.targets;
      overlap += frame.overlap_targets;
      determined = determined && frame.determined;
      joined = joined && frame.joined;
    }
    if (targets == 0) continue;
    v1::SetupRegistration& registration = *setup.mutable_registration();
    // An unjoined frame has no registration uncertainty; 0 would look like a good one.
    if (joined) {
      registration.set_standard_uncertainty_m(std::sqrt(squares_m2 / static_cast<double>(targets)));
    }
    registration.set_overlap_targets(overlap);
    registration.set_determined(determined);
  }
}

// Counts validation targets with admissible and with relaxed uncertainty after the scans.
absl::Status AddValidation(const PlanningSession& session, std::span<const Measurement> scans,
                           v1::PlanUncertainty& message) {
  if (session.measured_gain_model != nullptr) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto score, session.gain_model->ScorePlan(scans, true));
    const auto all = static_cast<double>(std::max<int64_t>(1, score.validation_measurable));
    message.set_fresh_judged_targets(score.validation_measurable);
    message.set_fresh_admissible_fraction(static_cast<double>(*score.validation_satisfied) / all);
    message.set_fresh_relaxed_fraction(static_cast<double>(*score.validation_relaxed) / all);
    return absl::OkStatus();
  }
  CoverageClient& client = *session.validation_client;
  SIGHTLINE_ASSIGN_OR_RETURN(auto exact, client.Uncertainties(scans, {}, false, {}));
  SIGHTLINE_RETURN_IF_ERROR(
      JoinScans(session.inspection, *session.requirements, client, scans, {}, exact).status());
  const std::vector<float> admissible_m =
      session.requirements->AdmissibleUncertainties(client.targets());
  const auto relaxed_m = static_cast<float>(session.requirements->relaxed_uncertainty_m);
  int64_t toleranced = 0, admissible = 0, relaxed = 0;
  for (size_t t = 0; t < admissible_m.size(); ++t) {
    if (!client.measurable().Test(t) || !(admissible_m[t] > 0)) continue;
    ++toleranced;
    admissible += exact.total_m[t] <= admissible_m[t];
    relaxed += exact.total_m[t] <= std::max(admissible_m[t], relaxed_m);
  }
  const auto total = static_cast<double>(std::max<int64_t>(1, toleranced));
  message.set_fresh_judged_targets(toleranced);
  message.set_fresh_admissible_fraction(static_cast<double>(admissible) / total);
  message.set_fresh_relaxed_fraction(static_cast<double>(relaxed) / total);
  return absl::OkStatus();
}

// Checks the linear propagation of errors at some targets of each scan.
void ExaminePropagation(const PlanningSession& session, const std::vector<ChosenScan>& scans,
                        v1::PlanUncertainty& message) {
  constexpr size_t kPerScan = 200;
  const Rig& rig = session.inspection.rig;
  const UncertaintyModel& model = *session.inspection.uncertainty;
  const Eigen::Vector3d centre = session.client->scene().part_centre_m;
  int64_t examined = 0, not_linear = 0;
  for (const ChosenScan& scan : scans) {
    const ScanGeometry geometry = MakeScanGeometry(rig, scan.measurement);
    const std::vector<uint32_t> covered = FullShares(scan.exact.covered).targets;
    const size_t stride = covered.size() / kPerScan + 1;
    for (size_t i = 0; i < covered.size(); i += stride) {
      const Eigen::Vector3d p = session.client->targets().positions_m[covered[i]].cast<double>();
      const double stage_m = geometry.LitStagePosition(PartToWorld(geometry, centre, p, 0));
      const TriangulationSetup setup = MakeTriangulationSetup(
          rig.camera, WorldToPart(geometry, centre, geometry.camera, stage_m),
          WorldToPart(geometry, centre, geometry.laser, stage_m));
      const Eigen::Vector3d n = session.client->targets().normals[covered[i]].cast<double>();
      const TriangulationCovariance covariance =
          model.calibration + DetectionCovariance(model, setup.camera, p, n);
      ++examined;
      not_linear +=
          !PropagateUncertainty(setup, ProjectPoint(setup, p), covariance).first_order_suffices();
    }
  }
  message.set_examined_points(examined);
  message.set_second_order_points(not_linear);
}

// Exact uncertainties after the plan's scans in their order, and their statistics.
absl::Status AddUncertainty(const PlanningSession& session, PlanDocument& document) {
  const Requirements& requirements = *session.requirements;
  document.admissible_uncertainty_m =
      requirements.AdmissibleUncertainties(session.client->targets());
  for (size_t t = 0; t < document.admissible_uncertainty_m.size(); ++t) {
    if (!session.client->measurable().Test(t)) document.admissible_uncertainty_m[t] = 0;
  }
  const std::vector<float>& admissible_m = document.admissible_uncertainty_m;
  const auto relaxed_m = static_cast<float>(requirements.relaxed_uncertainty_m);
  std::vector<Measurement> feasible;
  std::vector<int> index_of;  // of each feasible scan in the plan
  for (size_t i = 0; i < document.scans.size(); ++i) {
    if (document.scans[i].exact.feasibility != ScanFeasibility::kFeasible) continue;
    feasible.push_back(document.scans[i].measurement);
    index_of.push_back(static_cast<int>(i));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(document.uncertainties,
                             session.measured_gain_model != nullptr
                                 ? session.measured_gain_model->Uncertainties(feasible)
                                 : session.client->Uncertainties(feasible, {}, true, {}));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto knowledge,
                             JoinScans(session.inspection, *session.requirements, *session.client,
                                       feasible, {}, document.uncertainties));

  v1::PlanUncertainty& message = *document.plan.mutable_uncertainty();
  std::vector<float> uncertainty_m;
  std::vector<int64_t> admissible(feasible.size(), 0), relaxed(feasible.size(), 0);
  int64_t all_admissible = 0, all_relaxed = 0;
  for (size_t t = 0; t < admissible_m.size(); ++t) {
    if (!(admissible_m[t] > 0)) continue;
    const float loose_m = std::max(admissible_m[t], relaxed_m);
    const float u_m = document.uncertainties.total_m[t];
    uncertainty_m.push_back(u_m);
    all_admissible += u_m <= admissible_m[t];
    all_relaxed += u_m <= loose_m;
    for (size_t s = 0; s < feasible.size(); ++s) {
      const float after_m = document.uncertainties.after_each_scan_m[t * feasible.size() + s];
      admissible[s] += after_m <= admissible_m[t];
      relaxed[s] += after_m <= loose_m;
    }
  }
  document.uncertainties.after_each_scan_m.clear();
  int64_t admissible_so_far = 0, relaxed_so_far = 0;
  size_t s = 0;
  for (int i = 0; i < document.plan.scans_size(); ++i) {
    if (s < index_of.size() && index_of[s] == i) {
      admissible_so_far = admissible[s];
      relaxed_so_far = relaxed[s];
      ++s;
    }
    document.plan.mutable_scans(i)->set_cumulative_admissible_targets(admissible_so_far);
    document.plan.mutable_scans(i)->set_cumulative_relaxed_targets(relaxed_so_far);
  }
  const auto count = static_cast<int64_t>(uncertainty_m.size());
  const auto total = static_cast<double>(std::max<int64_t>(1, count));
  message.set_judged_targets(count);
  message.set_admissible_fraction(static_cast<double>(all_admissible) / total);
  message.set_relaxed_fraction(static_cast<double>(all_relaxed) / total);
  message.set_goal(*session.inspection.goal.admissible);
  message.set_relaxed_uncertainty_m(requirements.relaxed_uncertainty_m);
  if (!uncertainty_m.empty()) {
    const auto middle =
        uncertainty_m.begin() + static_cast<std::ptrdiff_t>(uncertainty_m.size() / 2);
    std::nth_element(uncertainty_m.begin(), middle, uncertainty_m.end());
    message.set_median_uncertainty_m(*middle);
  }
  for (v1::InadmissibleCount& inadmissible :
       CountInadmissible(TargetUncertaintiesOf(session, document))) {
    *message.add_inadmissible() = std::move(inadmissible);
  }
  ExaminePropagation(session, document.scans, message);
  const GainWeights& gain = session.inspection.goal.gain;
  message.mutable_gain()->set_coverage(gain.coverage);
  message.mutable_gain()->set_admissible(gain.admissible);
  message.mutable_gain()->set_relaxed(gain.relaxed);
  message.mutable_gain()->set_information(gain.information);
  message.mutable_gain()->set_total_uncertainty(gain.total_uncertainty);
  if (!requirements.features.empty() || !requirements.unbound.empty()) {
    AddVerdicts(session, knowledge, message);
  }
  AddRegistration(session, knowledge.shared, index_of, document.plan);
  if (session.validation_client && !feasible.empty()) {
    return AddValidation(session, feasible, message);
  }
  return absl::OkStatus();
}

}  // namespace

v1::Plan::StopReason StopReasonToProto(StopReason reason) {
  switch (reason) {
    case StopReason::kGoalReached:
      return v1::Plan::STOP_REASON_GOAL_REACHED;
    case StopReason::kMaxScans:
      return v1::Plan::STOP_REASON_MAX_SCANS;
    case StopReason::kMaxTime:
      return v1::Plan::STOP_REASON_MAX_TIME;
    case StopReason::kStalled:
      return v1::Plan::STOP_REASON_STALLED;
    case StopReason::kInterrupted:
      return v1::Plan::STOP_REASON_INTERRUPTED;
    case StopReason::kExecutionLimit:
      return v1::Plan::STOP_REASON_EXECUTION_LIMIT;
  }
  return v1::Plan::STOP_REASON_UNSPECIFIED;
}

absl::StatusOr<PlanDocument> MakePlanDocument(const PlanningSession& session,
                                              std::vector<ChosenScan> scans,
                                              const PlanSource& source) {
  const ExecutionModel execution = ExecutionModelOf(session.inspection);
  const CostModel& costs = execution.costs;
  const SceneInfo& scene = session.client->scene();
  std::vector<Measurement> measurements;
  int locked = 0;
  for (const ChosenScan& scan : scans) {
    measurements.push_back(scan.measurement);
    locked += scan.locked ? 1 : 0;
  }
  PlanDocument document;
  // Given scans that are only evaluated keep their order.
  const bool given = source.stop_reason == v1::Plan::STOP_REASON_EVALUATED;
  const int fixed = given ? static_cast<int>(scans.size()) : locked;
  std::vector<RobotMove> moves;
  std::vector<int> order;
  if (session.robot) {
    moves = OrderForRobot(session, scans, fixed);
    for (const RobotMove& move : moves) order.push_back(move.scan);
  } else {
    order = OrderScans(execution, measurements, fixed);
  }
  for (const int index : order) document.scans.push_back(std::move(scans[index]));

  v1::Plan& plan = document.plan;
  plan.set_inspection_name(session.inspection.name);
  plan.set_sightline_version(SIGHTLINE_VERSION);
  plan.set_strategy(source.strategy);
  plan.set_seed(source.seed);
  plan.set_part_digest(session.part_digest.Text());
  for (const std::string& remark : session.plan_remarks) plan.add_part_remarks(remark);
  plan.set_scene_digest(scene.scene_digest);
  plan.set_gain_evaluations(source.evaluations);
  plan.set_stop_reason(source.stop_reason);

  TargetBits covered(static_cast<size_t>(scene.target_count)), ungated = covered;
  TargetBits validation_covered(
      session.validation_client ? session.validation_client->targets().size() : 0);
  v1::PlanCost& cost = *plan.mutable_cost();
  double error_sum = 0, error_max = 0;
  for (size_t i = 0; i < document.scans.size(); ++i) {
    const ChosenScan& chosen = document.scans[i];
    v1::PlannedScan scan = DescribeScan(session, chosen);
    scan.set_index(static_cast<int>(i + 1));
    scan.set_covered_targets(chosen.exact.covered.Count());
    scan.set_new_targets(chosen.exact.covered.CountNotIn(covered));
    covered |= chosen.exact.covered;
    if (chosen.exact.validation_covered.size() == validation_covered.size())
      validation_covered |= chosen.exact.validation_covered;
    if (chosen.exact.covered_without_normal_gate.size() == ungated.size())
      ungated |= chosen.exact.covered_without_normal_gate;
    scan.set_cumulative_targets(covered.Count());
    scan.set_scan_time_s(ScanTimeS(costs, session.inspection.rig.scan_step_m,
                                   chosen.exact.first_frame, chosen.exact.last_frame));
    scan.set_reposition_time_s(
        i > 0 ? RepositionTimeS(execution, document.scans[i - 1].measurement, chosen.measurement)
              : TimesBeforeFirst(execution).Total_s());
    cost.set_scan_time_s(cost.scan_time_s() + scan.scan_time_s());
    cost.set_reposition_time_s(cost.reposition_time_s() + scan.reposition_time_s());
    if (session.robot) {
      DescribeMove(session, moves[i], &scan);
      plan.set_robot_move_time_s(plan.robot_move_time_s() + moves[i].move_time_s);
    }
    const double error =
        std::abs(static_cast<double>(chosen.fast_covered - scan.covered_targets())) /
        static_cast<double>(scene.target_count);
    error_sum += error;
    error_max = std::max(error_max, error);
    *plan.add_scans() = std::move(scan);
  }
  cost.set_unit_costs(costs.IsUnit());
  cost.set_total(costs.IsUnit()
                     ? static_cast<double>(document.scans.size())
                     : cost.scan_time_s() + cost.reposition_time_s() + plan.robot_move_time_s());

  v1::PlanCoverage& coverage = *plan.mutable_coverage();
  coverage.set_targets(scene.target_count);
  coverage.set_measurable_targets(scene.measurable_count);
  coverage.set_measurable_in_free_space_targets(scene.measurable_in_free_space_count);
  coverage.set_covered_targets(covered.Count());
  coverage.set_coverage(static_cast<double>(covered.Count()) /
                        static_cast<double>(scene.measurable_count));
  ungated &= session.client->measurable();
  coverage.set_covered_targets_without_normal_gate(ungated.Count());
  if (!document.scans.empty())
    coverage.set_fast_mean_absolute_error(error_sum / static_cast<double>(document.scans.size()));
  coverage.set_fast_max_absolute_error(error_max);
  coverage.set_goal(session.inspection.goal.coverage);
  if (session.validation_client && !session.ForUncertainty()) {
    const int64_t fresh = session.validation_client->measurable().Count();
    coverage.set_fresh_measurable_targets(fresh);
    coverage.set_fresh_coverage(static_cast<double>(validation_covered.Count()) /
                                static_cast<double>(std::max<int64_t>(1, fresh)));
  }
  AddSetups(session, &plan);
  AddRemarks(session, document.scans, given, &plan);
  AddScanQuality(session, document);
  if (session.ForUncertainty()) {
    SIGHTLINE_RETURN_IF_ERROR(AddUncertainty(session, document));
  }
  return document;
}

namespace {

// Targets of the goal, or the number that the plan satisfies if that is smaller.
int64_t TargetsOfBounds(const PlanningSession& session, const v1::Plan& plan) {
  const double satisfied = plan.has_uncertainty() ? plan.uncertainty().admissible_fraction()
                                                  : plan.coverage().coverage();
  const double fraction = std::min(GoalFraction(session.inspection.goal), satisfied);
  return static_cast<int64_t>(
      std::ceil(fraction * static_cast<double>(session.gain_model->measurable().Count()) - 1e-9));
}

v1::ExecutionBound BoundToProto(double value, bool converged, const std::string& statement) {
  v1::ExecutionBound message;
  message.set_value(value);
  message.set_converged(converged);
  message.set_statement(statement);
  return message;
}

}  // namespace

void SetBound(const PlanningSession& session, ScanCountBoundResult bound, v1::Plan& plan) {
  const TargetBits& wanted = session.gain_model->measurable();
  const int64_t goal_targets = TargetsOfBounds(session, plan);
  // The search reserves room for shared errors, so its bound applies to stricter requirements.
  const bool stricter = session.ForUncertainty() && HasSharedErrors(session.inspection);
  if (stricter) bound.converged = false;
  LowerGoal(wanted, goal_targets, bound);
  if (stricter) {
    absl::StrAppend(
        &bound.statement,
        " The search leaves a tenth of the admissible uncertainty for errors that scans "
        "share: a plan with fewer scans is possible.");
  }
  v1::ScanCountBound& message = *(
      plan.has_uncertainty() ? plan.mutable_uncertainty()->mutable_bound() : plan.mutable_bound());
  message.set_scans(bound.bound);
  message.set_converged(bound.converged);
  message.set_pricing_evaluations(bound.evaluations);
  message.set_statement(bound.statement);
  if (session.inspection.costs.IsUnit()) return;
  const ExecutionBounds execution =
      BoundExecution(ExecutionModelOf(session.inspection),
                     BoundFaces(session.client->measurable_orientations(), wanted, goal_targets),
                     bound.scans, bound.converged);
  *message.mutable_setups() =
      BoundToProto(execution.setups, execution.setups_converged, execution.setups_statement);
  *message.mutable_time_s() =
      BoundToProto(execution.time_s, execution.time_converged, execution.time_statement);
}

namespace {

// States the fraction that the rig cannot measure, and why planning missed the goal.
std::string SummariseReach(const v1::Plan& plan) {
  const v1::PlanCoverage& c = plan.coverage();
  std::string text;
  const auto share = [&](int64_t targets) {
    return 100 * static_cast<double>(targets) /
           static_cast<double>(std::max<int64_t>(1, c.targets()));
  };
  if (c.measurable_in_free_space_targets() > c.measurable_targets()) {
    absl::StrAppendFormat(
        &text,
        "of all %d targets, this rig cannot measure %.1f %% (resting faces, domain, "
        "table, limits); no rig can measure a further %.1f %%.\n",
        c.targets(), share(c.measurable_in_free_space_targets() - c.measurable_targets()),
        share(c.targets() - c.measurable_in_free_space_targets()));
  }
  if (plan.stop_reason() == v1::Plan::STOP_REASON_STALLED && !plan.has_uncertainty()) {
    absl::StrAppendFormat(
        &text,
        "the goal was not reached: further scans would add less than goal.min_gain. "
        "Line of sight and table allow this rig to measure the remaining %d "
        "targets.\n",
        c.measurable_targets() - c.covered_targets());
  }
  if (plan.resting_faces_size() > 0) {
    for (const v1::ExcludedFace& excluded : plan.excluded_faces()) {
      absl::StrAppend(&text, "face ", excluded.face().name(), " is not used: ", excluded.because(),
                      ".\n");
    }
    absl::StrAppend(&text, "the part is laid on ",
                    plan.resting_faces_size() == 1 ? "face " : "faces ",
                    absl::StrJoin(plan.resting_faces(), ", ",
                                  [](std::string* out, const v1::RestingFace& face) {
                                    absl::StrAppend(out, face.name());
                                  }),
                    ".\n");
  }
  for (const v1::PlannedScan& scan : plan.scans()) {
    for (const std::string& remark : scan.remarks()) {
      absl::StrAppendFormat(&text, "scan %d: %s.\n", scan.index(), remark);
    }
  }
  return text;
}

// The bounds as sentences, one per line; empty without a bound.
std::string SummariseBound(const v1::ScanCountBound& bound) {
  std::string text;
  for (const std::string* statement :
       {&bound.statement(), &bound.setups().statement(), &bound.time_s().statement()}) {
    if (!statement->empty()) absl::StrAppend(&text, *statement, "\n");
  }
  return text;
}

// Set-ups and the time to execute the plan.
std::string SummariseSetups(const v1::Plan& plan) {
  const auto count = [](int number, const char* one, const char* several) {
    return absl::StrCat(number, " ", number == 1 ? one : several);
  };
  std::string text = absl::StrFormat("%s from %s of the sensors; executing the plan takes %.1f min",
                                     count(plan.setups_size(), "set-up", "set-ups"),
                                     count(plan.sensor_places_size(), "place", "places"),
                                     plan.cost().total() / 60);
  double turn_s = 0, lay_s = 0, move_s = 0;
  for (const v1::Setup& setup : plan.setups()) {
    turn_s += setup.time_s().turn();
    lay_s += setup.time_s().lay();
    move_s += setup.time_s().move_sensors();
  }
  absl::StrAppendFormat(&text,
                        ": scanning %.1f, turning the part %.1f, laying it %.1f, placing the "
                        "sensors %.1f.\n",
                        plan.cost().scan_time_s() / 60, turn_s / 60, lay_s / 60, move_s / 60);
  if (plan.stop_reason() == v1::Plan::STOP_REASON_EXECUTION_LIMIT) {
    absl::StrAppend(&text,
                    "the goal was not reached within the limits on time to execute, set-ups, "
                    "sensor places or resting faces (goal.execution_time_s, max_setups, "
                    "max_sensor_places, max_resting_faces).\n");
  }
  return text;
}

}  // namespace

std::string SummarisePlan(const v1::Plan& plan) {
  const v1::PlanCoverage& c = plan.coverage();
  std::string text;
  for (const std::string& remark : plan.part_remarks()) absl::StrAppend(&text, remark, ".\n");
  absl::StrAppendFormat(
      &text,
      "%d %s %.2f %% of the %d measurable targets (%swithout the gate on normals %.2f %%).\n"
      "fast estimate of this plan's scans against exact: mean |error| %.3f %%, largest %.3f %% of "
      "all "
      "targets.\n",
      plan.scans_size(), plan.scans_size() == 1 ? "scan measures" : "scans measure",
      100 * c.coverage(), c.measurable_targets(),
      c.goal() > 0 ? absl::StrFormat("goal %.4g %%; ", 100 * c.goal()) : "",
      100.0 * static_cast<double>(c.covered_targets_without_normal_gate()) /
          static_cast<double>(std::max<int64_t>(1, c.measurable_targets())),
      100 * c.fast_mean_absolute_error(), 100 * c.fast_max_absolute_error());
  text += SummariseReach(plan);
  if (plan.coverage().has_fresh_coverage()) {
    absl::StrAppendFormat(&text, "of %d validation targets: %.2f %%.\n",
                          c.fresh_measurable_targets(), 100 * c.fresh_coverage());
  }
  text += SummarisePlacement(plan);
  if (plan.has_uncertainty()) {
    const v1::PlanUncertainty& u = plan.uncertainty();
    absl::StrAppendFormat(&text,
                          "uncertainty is admissible at %.2f %% of the %d toleranced targets (goal "
                          "%.4g %%), at most %.3g mm at %.2f %%; median %.1f um.\n",
                          100 * u.admissible_fraction(), u.judged_targets(), 100 * u.goal(),
                          1e3 * u.relaxed_uncertainty_m(), 100 * u.relaxed_fraction(),
                          1e6 * u.median_uncertainty_m());
    if (u.has_fresh_admissible_fraction()) {
      absl::StrAppendFormat(&text, "of %d validation targets: admissible at %.2f %%.\n",
                            u.fresh_judged_targets(), 100 * u.fresh_admissible_fraction());
    }
    if (u.second_order_points() > 0) {
      absl::StrAppendFormat(&text,
                            "linear propagation of errors is unreliable at %d of %d points "
                            "examined.\n",
                            u.second_order_points(), u.examined_points());
    }
    for (const std::string& statement : {u.registration(), u.calibration()}) {
      if (!statement.empty()) absl::StrAppend(&text, statement, "\n");
    }
    text += SummariseInadmissible(u);
    text += SummariseVerdicts(u);
    text += SummariseBound(u.bound());
  }
  text += SummariseUncovered(plan.coverage());
  text += SummariseBound(plan.bound());
  if (!plan.cost().unit_costs()) {
    text += SummariseSetups(plan);
  }
  int robot_scans = 0, unreached = 0;
  for (const v1::PlannedScan& scan : plan.scans()) {
    robot_scans += scan.has_robot();
    unreached += scan.has_robot() && !scan.robot().reachable();
  }
  if (robot_scans > 0) {
    absl::StrAppendFormat(
        &text, "the robot moves %.1f s between scans%s.\n", plan.robot_move_time_s(),
        unreached == 0
            ? ""
            : absl::StrFormat("; it cannot make %d of %d scans", unreached, robot_scans));
  }
  return text;
}

}  // namespace sightline
