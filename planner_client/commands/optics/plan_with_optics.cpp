// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/optics/plan_with_optics.h"

#include <cstdio>
#include <memory>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/status/status_macros.h"
#include "planner_client/command_line/process/interrupt.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/optics/optics_outputs.h"
#include "planner_client/commands/optics/optics_request.h"
#include "planner_client/commands/planning/plan_outputs.h"
#include "planner_client/optics_client/detection_change.h"
#include "planner_client/optics_client/optics_client.h"

namespace sightline {
namespace {

// An f-number whose cost exceeds the best one's by this factor is not evaluated again.
constexpr double kWorthTrying = 1.6;

// The inspection's own request about the plan in the folder.
absl::StatusOr<OpticsRequest> RequestFor(const JointPlanOptions& options) {
  FrameChoice frames;
  frames.input = options.session.inspection_file;
  frames.out = options.folder;
  frames.plan = options.folder + "/plan.json";
  auto request = MakeOpticsRequest(frames);
  if (request.ok()) request->request.set_seed(options.seed);
  return request;
}

void KeepFNumbersWorthTrying(const v1::OpticsPlan& before, v1::CreateOpticsRequest* request) {
  auto* f_numbers = request->mutable_inspection()->mutable_optics()->mutable_f_numbers();
  f_numbers->Clear();
  for (const v1::OpticsPoint& point : before.curve()) {
    if (point.cost() <= kWorthTrying * before.best().cost()) f_numbers->Add(point.f_number());
  }
}

absl::StatusOr<v1::OpticsPlan> ChooseSettings(const JointPlanOptions& options, bool per_scan,
                                              const v1::OpticsPlan* before, const char* what) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto request, RequestFor(options));
  request.request.set_per_scan(per_scan);
  if (before != nullptr) KeepFNumbersWorthTrying(*before, &request.request);
  PrintTextTo(stderr, "%s\n", what);
  ProgressLine progress;
  WorkerClientOptions client;
  SIGHTLINE_ASSIGN_OR_RETURN(auto worker, StartWorkerSession(options.worker, &progress, &client));
  auto optics = PlanOptics(client, request.request, request.assets);
  progress.Finish();
  if (!optics.ok()) return AboutInput(optics.status(), options.session.inspection_file);
  return optics;
}

std::vector<Measurement> ScansOf(const PlanDocument& document, bool locked) {
  std::vector<Measurement> scans;
  for (const ChosenScan& scan : document.scans) {
    if (scan.locked == locked) scans.push_back(scan.measurement);
  }
  return scans;
}

std::vector<Measurement> ScansOf(const PlanDocument& document) {
  std::vector<Measurement> scans;
  for (const ChosenScan& scan : document.scans) scans.push_back(scan.measurement);
  return scans;
}

void Say(int number, const v1::JointRound& round) {
  PrintTextTo(stderr,
              "round %d: %d scans, f/%.3g, %.4g ms; learned u differs by %.1f %% from the planned "
              "one (%.1f standard errors); %.1f %% admissible with the learned one\n",
              number, round.scans(), round.setting().f_number(),
              1e3 * round.setting().exposure_time_s(), 100 * round.change_of_u(),
              round.change_in_standard_errors(), 100 * round.settled_with());
}

class JointPlanner {
 public:
  JointPlanner(const JointPlanOptions& options, PlannerRequest request, PlanningSession* session,
               PlanDocument* document)
      : options_(options), request_(std::move(request)), session_(*session), document_(*document) {}

  absl::StatusOr<v1::OpticsPlan> Run() {
    if (session_.ForUncertainty()) {
      SIGHTLINE_RETURN_IF_ERROR(FindRest());
    }
    auto optics = ChooseSettings(options_, true, last_ ? &*last_ : nullptr,
                                 "choosing the setting of every scan");
    if (!optics.ok()) return optics;
    for (const v1::JointRound& round : rounds_) *optics->add_rounds() = round;
    optics->set_rounds_converged(converged_);
    if (!missing_.empty()) optics->add_warnings(missing_);
    return optics;
  }

 private:
  // Alternates planning and learning until the learned detection equals the planned one.
  absl::Status FindRest() {
    LineDetectionNoise planned_for = session_.inspection.uncertainty->detection;
    double earlier_error = 0;
    for (int number = 1; number <= options_.max_rounds; ++number) {
      SIGHTLINE_ASSIGN_OR_RETURN(
          auto optics,
          ChooseSettings(
              options_, false, last_ ? &*last_ : nullptr,
              absl::StrCat("round ", number, ": choosing one setting for all scans").c_str()));
      v1::JointRound round;
      round.set_scans(static_cast<int>(document_.scans.size()));
      round.set_settled_for(document_.plan.uncertainty().admissible_fraction());
      *round.mutable_setting() = optics.best().setting();
      if (!optics.common().has_detection()) {
        missing_ =
            "too few points of the line were detected to learn their uncertainty; the scans use "
            "the "
            "inspection's own line_detection";
        rounds_.push_back(round);
        return absl::OkStatus();
      }
      const v1::LearnedDetection& learned = optics.common().detection();
      *round.mutable_detection() = learned;
      const DetectionChange change = ChangeOf(planned_for, earlier_error, learned);
      round.set_change_of_u(change.root_mean_square);
      round.set_change_in_standard_errors(change.in_standard_errors);
      const bool same_setting = last_ && last_->best().f_number() == optics.best().f_number();
      SIGHTLINE_ASSIGN_OR_RETURN(planned_for, NoiseOf(learned));
      earlier_error = MeanError(learned);
      last_ = std::move(optics);
      SIGHTLINE_RETURN_IF_ERROR(LookWith(planned_for, &round));
      Say(number, round);
      // Scans that reached the goal reach it with the learned detection, too.
      const double goal = GoalFraction(request_.goal);
      const bool as_good = round.settled_with() >= goal || round.settled_for() < goal;
      converged_ = change.IsNone() && (same_setting || number == 1) && as_good;
      rounds_.push_back(std::move(round));
      // Updates the plan's numbers for the learned detection.
      if (converged_) {
        return MakeDocument(std::move(document_.scans), document_.plan.gain_evaluations(),
                            document_.plan.stop_reason());
      }
      SIGHTLINE_RETURN_IF_ERROR(PlanAgain());
    }
    return absl::OkStatus();
  }

  // Evaluates the present scans exactly with the learned detection, which later plans use.
  absl::Status LookWith(const LineDetectionNoise& noise, v1::JointRound* round) {
    SessionOptions options = options_.session;
    options.line_detection = noise;
    SIGHTLINE_ASSIGN_OR_RETURN(auto session, OpenSession(options));
    session.inspection.goal = session_.inspection.goal;
    session_ = std::move(session);
    SIGHTLINE_ASSIGN_OR_RETURN(auto score,
                               session_.gain_model->ScorePlan(ScansOf(document_), true));
    round->set_settled_with(static_cast<double>(score.satisfied) /
                            static_cast<double>(std::max<int64_t>(1, score.measurable)));
    return absl::OkStatus();
  }

  absl::Status PlanAgain() {
    request_.locked = ScansOf(document_, true);
    request_.starting = ScansOf(document_, false);
    SIGHTLINE_ASSIGN_OR_RETURN(auto result, MakePlan(*session_.gain_model, request_));
    SIGHTLINE_RETURN_IF_ERROR(MakeDocument(std::move(result.scans), result.evaluations,
                                           StopReasonToProto(result.stop_reason)));
    return InterruptFlag() ? absl::CancelledError("interrupted") : absl::OkStatus();
  }

  absl::Status MakeDocument(std::vector<ChosenScan> scans, int64_t evaluations,
                            v1::Plan::StopReason stop_reason) {
    SIGHTLINE_ASSIGN_OR_RETURN(
        document_, MakePlanDocument(session_, std::move(scans),
                                    {request_.strategy, request_.seed, evaluations, stop_reason}));
    return WritePlanJson(document_, options_.folder);
  }

  const JointPlanOptions& options_;
  PlannerRequest request_;
  PlanningSession& session_;
  PlanDocument& document_;
  std::optional<v1::OpticsPlan> last_;
  std::vector<v1::JointRound> rounds_;
  bool converged_ = false;
  std::string missing_;
};

}  // namespace

absl::StatusOr<v1::OpticsPlan> PlanWithOptics(const JointPlanOptions& options,
                                              const PlannerRequest& request,
                                              PlanningSession* session, PlanDocument* document) {
  return JointPlanner(options, request, session, document).Run();
}

}  // namespace sightline
