// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/inspection/next_scan.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/inspection/inspection.h"
#include "core/part/point_index.h"
#include "core/status/status_macros.h"
#include "planner_client/command_line/process/interrupt.h"
#include "planner_client/command_line/process/progress_line.h"
#include "planner_client/replanning/measured_gain_model.h"
#include "planning/strategy/execution/execution_model.h"
#include "planning/strategy/planner.h"

namespace sightline {
namespace {

constexpr ProgressPhase kSearchPhase{kOpenSessionPhase.end, 1};

// Required uncertainty of every target [m]; 0 for targets that need no scan. The server samples the
// part as measured, with its deviations, so its targets differ from those of the verdict: each
// takes the value of the nearest target of the same feature.
std::vector<float> NeededAt(const TargetSet& targets, const Requirements& requirements,
                            const JudgedInspection& judged) {
  std::vector<float> needed_m(targets.size(), 0);
  for (size_t f = 0; f < requirements.features.size(); ++f) {
    if (judged.needed[f].empty()) continue;
    std::vector<Eigen::Vector3f> places;
    for (const NeededUncertainty& place : judged.needed[f]) places.push_back(place.position_m);
    const PointIndex<3> index(std::move(places));
    for (const uint32_t t : requirements.TargetsOf(requirements.features[f], targets)) {
      const float value_m = judged.needed[f][index.Nearest(targets.positions_m[t])].uncertainty_m;
      if (value_m > 0) needed_m[t] = needed_m[t] > 0 ? std::min(needed_m[t], value_m) : value_m;
    }
  }
  return needed_m;
}

PlannerRequest RequestOf(const PlanningSession& session, const EarlierPlan& earlier,
                         const NextScanQuestion& question) {
  PlannerRequest request;
  request.domain = session.inspection.domain;
  request.goal = session.inspection.goal;
  request.goal.admissible = 1;
  request.locked = earlier.Measured();
  request.goal.max_scans = static_cast<int>(request.locked.size()) + 1;
  request.goal.max_time_s.reset();
  request.strategy = "greedy-pso";
  request.seed = question.seed;
  request.evaluations_per_scan = question.evaluations;
  request.execution = ExecutionModelOf(session.inspection);
  request.with_curves = false;
  request.interrupted = &InterruptFlag();
  return request;
}

}  // namespace

absl::StatusOr<std::optional<v1::NextScan>> FindNextScan(const NextScanQuestion& question,
                                                         const EarlierPlan& earlier,
                                                         std::shared_ptr<const MeasuredPart> part,
                                                         const JudgedInspection& judged) {
  SessionOptions options;
  options.inspection_file = question.inspection_file;
  options.coverage_server = question.coverage_server;
  options.tls = question.tls;
  options.fresh_targets = false;
  options.kept_scans = earlier.Measured();
  options.before_upload = [part](PlanningSession& session, CoverageTask& task) {
    return PutFoundPart(part, session, task);
  };
  SIGHTLINE_ASSIGN_OR_RETURN(auto session, OpenSession(options));
  CoverageClient& client = *session.client;
  const Inspection& inspection = session.inspection;
  const double relaxed_m = session.requirements->relaxed_uncertainty_m;
  if (session.requirements->features.size() != judged.needed.size()) {
    return absl::AbortedError(absl::StrCat(
        question.inspection_file, ": its tolerances have changed while it was read; start again"));
  }
  const TolerancedTargets needed =
      FindTolerancedTargets(client, *inspection.uncertainty, inspection.targets,
                            NeededAt(client.targets(), *session.requirements, judged), relaxed_m);
  if (needed.bits.Count() == 0) return std::nullopt;
  auto simulated = std::make_unique<UncertaintyGainModel>(
      UncertaintyGainModel::Sampling{&client, needed}, UncertaintyGainModel::Sampling{nullptr, {}},
      *inspection.uncertainty, inspection.goal.gain, relaxed_m);
  MeasuredGainModel gain_model(std::move(simulated), earlier.Measured(),
                               MeasuredTargetsOf(session, client, needed), std::nullopt, relaxed_m);
  ProgressLine progress(kSearchPhase);
  PlannerRequest request = RequestOf(session, earlier, question);
  request.on_progress = [&progress](const PlanProgress& p) { progress.Show(p.done, p.phase); };
  auto plan = MakePlan(gain_model, request);
  progress.Finish();
  if (!plan.ok()) return plan.status();
  if (plan->scans.size() <= request.locked.size()) return std::nullopt;
  SIGHTLINE_ASSIGN_OR_RETURN(const auto score, gain_model.ScorePlan(request.locked, true));
  // The search adds a scan even if no scan helps.
  if (plan->score.satisfied <= score.satisfied) return std::nullopt;
  v1::NextScan next;
  *next.mutable_measurement() = MeasurementToProto(plan->scans.back().measurement);
  next.set_open_targets(needed.bits.Count() - score.satisfied);
  next.set_settled_targets(plan->score.satisfied - score.satisfied);
  for (const v1::InspectedFeature& feature : judged.result.features()) {
    if (feature.decision() == v1::InspectedFeature::UNDECIDED) next.add_features(feature.name());
  }
  return std::optional<v1::NextScan>(std::move(next));
}

}  // namespace sightline
