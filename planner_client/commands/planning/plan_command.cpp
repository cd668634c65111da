// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/command_options/option_values.h"
#include "core/json/strict_json.h"
#include "core/text/number_text.h"
#include "planner_client/command_line/help/terminal.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/interrupt.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/command_line/process/progress_line.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/optics/optics_outputs.h"
#include "planner_client/commands/other_part.h"
#include "planner_client/commands/part_assets.h"
#include "planner_client/commands/planning/as_measured_session.h"
#include "planner_client/commands/planning/pareto_outputs.h"
#include "planner_client/commands/planning/plan_document.h"
#include "planner_client/commands/planning/plan_outputs.h"
#include "planner_client/commands/planning/plan_with_optics.h"
#include "planner_client/commands/planning/planning_session.h"
#include "planner_client/commands/shard.h"
#include "planner_client/commands/starts/plan_starts.h"
#include "planner_client/commands/starts/search_checkpoint.h"
#include "planner_client/multi_start/start_result.h"
#include "planner_client/pareto/frame_estimate.h"
#include "planner_client/plan_file/plan_file.h"
#include "planner_client/report/optics/optics_report.h"
#include "planner_client/strategy/execution/least_time_plan.h"
#include "planner_client/strategy/generated_columns_plan.h"
#include "planner_client/strategy/scan_order.h"

namespace sightline {
namespace {

// Fractions of the whole command, by the time that the example head takes; opening the session
// comes before, the outputs after.
constexpr ProgressPhase kPlanningPhase{kOpenSessionPhase.end, 0.5};
constexpr ProgressPhase kBoundPhase{0.5, 0.7};
constexpr ProgressPhase kAgainPhase{0.7, 0.87};
constexpr ProgressPhase kLeastTimePhase{0.87, 0.95};

struct PlanOptions {
  SessionOptions session;
  OutputOptions output;
  std::string strategy = "refined";
  std::string keep;
  std::string checkpoint;
  bool resume = false;
  AsMeasuredOptions measured;
  ParetoOptions pareto;
  StartsOptions starts;
  int64_t seed = 1;
  std::optional<double> goal;
  std::optional<int> max_scans;
  std::optional<double> max_time_s, goal_time_s;
  std::optional<int> max_setups, max_sensor_places, max_resting_faces;
  int64_t evaluations_per_scan = 5000;
  int64_t matrix_samples = 1500000;
  int64_t bound_evaluations = 100000;
  bool optics = false;
  int optics_rounds = 4;
  WorkerSessionOptions worker;
};

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// Wrong input is found before the scene is built, which takes seconds.
absl::Status ReadGivenScans(PlanOptions& options, PlannerRequest& request) {
  if (!options.keep.empty()) {
    auto kept = ReadPlanScans(options.keep, &options.session.plans);
    if (!kept.ok()) return kept.status();
    request.locked = std::move(kept->all);
  }
  if (options.resume) {
    const std::string path = options.output.folder + "/plan.json";
    auto earlier = ReadPlanScans(path, &options.session.plans);
    if (!earlier.ok()) return earlier.status();
    for (size_t i = 0; i < earlier->all.size(); ++i) {
      (earlier->locked[i] ? request.locked : request.starting).push_back(earlier->all[i]);
    }
  }
  return absl::OkStatus();
}

// optics.json, its report, and the settings of the plan's scans.
absl::Status WriteOptics(const v1::OpticsPlan& optics, const std::string& folder, v1::Plan* plan) {
  v1::OpticsPlan named = optics;
  named.set_sightline_version(SIGHTLINE_VERSION);
  SetSettings(named, plan);
  for (const std::string& warning : named.warnings()) {
    PrintTextTo(stderr, "warning: %s\n", warning.c_str());
  }
  if (absl::Status s = WriteOpticsJson(named, folder + "/optics.json"); !s.ok()) return s;
  return WriteOpticsReport(named, nullptr, folder + "/optics.html");
}

// Scans that were measured, if any.
absl::StatusOr<EarlierPlan> ReadMeasuredScans(PlanOptions& options, PlannerRequest& request) {
  if (options.measured.files.empty()) return EarlierPlan{};
  if (!options.resume) {
    return absl::InvalidArgumentError(
        "--measured: needs --resume, since the points are of scans of the plan.json in --out");
  }
  if (options.optics) {
    return absl::InvalidArgumentError("--optics and --measured exclude each other");
  }
  return LockMeasuredScans(options.measured, options.output.folder, &request);
}

// Checks the inputs of --optics before the scene is built.
absl::Status CheckOptics(const PlanOptions& options) {
  if (!options.optics) return absl::OkStatus();
  if (!options.checkpoint.empty()) {
    return absl::InvalidArgumentError(
        "--optics and --checkpoint exclude each other: what the render worker answers is not kept");
  }
  if (options.pareto.front) {
    return absl::InvalidArgumentError(
        "--optics and --pareto exclude each other: pick a plan, then `sightline optics --plan`");
  }
  v1::Inspection message;
  const std::string& file = options.session.inspection_file;
  if (absl::Status s = ReadStrictJsonFile(file, &message); !s.ok()) return s;
  return CheckImagingInspection(message, file).status();
}

// Sets the fields of the request that only the options give.
void SetOptions(const PlanOptions& options, PlannerRequest& request) {
  request.strategy = options.strategy;
  request.seed = options.seed;
  request.evaluations_per_scan = options.evaluations_per_scan;
  request.matrix_samples = options.matrix_samples;
  request.with_curves = false;
  request.interrupted = &InterruptFlag();
}

void SetGoal(const PlanOptions& options, PlanningGoal& goal) {
  if (options.goal) (goal.admissible ? *goal.admissible : goal.coverage) = *options.goal;
  if (options.max_scans) goal.max_scans = *options.max_scans;
  if (options.max_time_s) goal.max_time_s = *options.max_time_s;
  if (options.goal_time_s) goal.execution_time_s = *options.goal_time_s;
  if (options.max_setups) goal.max_setups = *options.max_setups;
  if (options.max_sensor_places) goal.max_sensor_places = *options.max_sensor_places;
  if (options.max_resting_faces) goal.max_resting_faces = *options.max_resting_faces;
}

// One plan, step by step, on a session that is open.
class Planning {
 public:
  Planning(PlanOptions& options, PlannerRequest request, const Shard& part,
           const EarlierPlan& earlier, std::optional<SearchQuestion> question,
           PlanningSession& session, std::chrono::steady_clock::time_point start)
      : options_(options),
        part_(part),
        earlier_(earlier),
        question_(std::move(question)),
        session_(session),
        request_(std::move(request)),
        start_(start),
        progress_(kPlanningPhase) {
    const SceneInfo& scene = session_.client->scene();
    AddTiming("target points", scene.targets_time_s);
    AddTiming("visibility data", scene.field_time_s);
    AddTiming("measurability", scene.measurability_time_s);
    AddTiming("loading, upload and start of the server",
              session_.open_time_s - scene.targets_time_s - scene.field_time_s -
                  scene.measurability_time_s);
    SetGoal(options_, session_.inspection.goal);
    request_.domain = session_.inspection.domain;
    request_.goal = session_.inspection.goal;
    request_.execution = ExecutionModelOf(session_.inspection);
    request_.scan_time_s =
        [this,
         frames = FrameEstimate(session_.inspection.rig, session_.client->scene().part_centre_m,
                                session_.client->targets())](const Measurement& scan) {
          const FrameRange range = frames.Frames(scan);
          return ScanTimeS(session_.inspection.costs, session_.inspection.rig.scan_step_m,
                           range.first, range.last);
        };
    SetOptions(options_, request_);
    request_.on_progress = [this](const PlanProgress& p) {
      Show(p.done,
           absl::StrFormat("%d scans, %.1f %% %s, %dk evaluations: %s", p.scans, 100 * p.coverage,
                           session_.ForUncertainty() ? "admissible" : "covered",
                           p.evaluations / 1000, p.phase));
    };
  }

  absl::Status Run() {
    absl::StatusOr<SearchCheckpoint> checkpoint;
    if (question_) {
      checkpoint = SearchCheckpoint::Open(options_.checkpoint, session_, *question_, request_,
                                          options_.bound_evaluations);
    } else {
      checkpoint.emplace();
    }
    if (!checkpoint.ok()) return checkpoint.status();
    if (options_.starts.Several()) {
      if (auto status = SearchFromAllStarts(*checkpoint); !status.ok()) return status;
      if (!part_.IsWhole()) return absl::OkStatus();
    } else {
      if (auto status = checkpoint->KeepAnswers("", &session_); !status.ok()) return status;
      if (auto status = Search(); !status.ok()) return status;
    }
    if (options_.optics && GoesOn()) {
      if (auto status = PlanOptically(); !status.ok()) return status;
    }
    if (bound_) SetBound(session_, *bound_, document_.plan);
    return WritePlanOutputs(session_, document_, options_.output);
  }

  void Print() const {
    if (!part_.IsWhole()) {
      if (!InterruptFlag()) PrintText("shard %d of %d is done\n", part_.number, part_.count);
      return;
    }
    PrintWrapped(absl::StrFormat(
        "%s%s%s%.1f s from cold start to plan, %.1f s in all with lower bound, better plans, "
        "reasons, "
        "pictures and files.\n",
        SummarisePlan(document_.plan), SummariseStarts(document_.plan),
        SummariseAsMeasured(document_.plan), time_to_plan_s_, SecondsSince(start_)));
    if (options_.output.pareto) {
      PrintText("%s", SummarisePareto(*options_.output.pareto).c_str());
    }
    PrintText("plan:   %s\nreport: %s\n",
              std::filesystem::absolute(options_.output.folder + "/plan.json").c_str(),
              std::filesystem::absolute(options_.output.folder + "/report.html").c_str());
  }

 private:
  bool GoesOn() const { return !InterruptFlag() && !document_.scans.empty(); }

  void AddTiming(const std::string& name, double seconds) {
    options_.output.timings.push_back({name, seconds});
  }

  // Phases of a search are parts of `search_phase_`.
  void Enter(const ProgressPhase& phase) {
    const double scale =
        (search_phase_.end - search_phase_.begin) / (kLeastTimePhase.end - kPlanningPhase.begin);
    progress_.Enter({search_phase_.begin + (phase.begin - kPlanningPhase.begin) * scale,
                     search_phase_.begin + (phase.end - kPlanningPhase.begin) * scale});
  }
  void Show(double fraction, const std::string& text) {
    progress_.Show(fraction, search_name_ + text);
  }

  // One search for the plan: result_, document_ and bound_.
  absl::Status Search() {
    if (auto status = SearchFewest(); !status.ok()) return status;
    if (options_.pareto.front || InterruptFlag() || !WantsLeastTime(request_)) {
      return absl::OkStatus();
    }
    return PlanLeastTime();
  }

  // The plan of least time, from the plan of fewest scans.
  absl::Status PlanLeastTime() {
    PlannerRequest request = request_;
    if (request.goal.max_time_s) {
      *request.goal.max_time_s -= SecondsSince(search_start_);
      if (*request.goal.max_time_s <= 0) return absl::OkStatus();
    }
    const auto least_start = std::chrono::steady_clock::now();
    Enter(kLeastTimePhase);
    std::vector<Measurement> good;
    if (bound_) good = bound_->generated_columns;
    auto result = PlanInLeastTime(*session_.oracle, request, std::move(result_), good);
    progress_.Finish();
    if (!result.ok()) return result.status();
    result_ = *std::move(result);
    AddTiming(search_name_ + "planning fewer set-ups", SecondsSince(least_start));
    return Describe();
  }

  // The plan of fewest scans, and the bound on their number.
  absl::Status SearchFewest() {
    search_start_ = std::chrono::steady_clock::now();
    const bool bounded = options_.bound_evaluations > 0;
    // All plans of a front profit from the bound's scans.
    if (options_.pareto.front && bounded) {
      if (auto status = FindBound({}, 1); !status.ok()) return status;
      request_.candidates = bound_->generated_columns;
    }
    // The bound's scans are better than those of a longer search without them.
    PlannerRequest request = request_;
    request.draft = bounded && !options_.pareto.front;
    if (auto status = Plan(request); !status.ok()) return status;
    if (options_.pareto.front || !bounded || !GoesOn()) return absl::OkStatus();
    std::vector<Measurement> scans;
    for (const ChosenScan& scan : document_.scans) scans.push_back(scan.measurement);
    const double settled = session_.ForUncertainty()
                               ? document_.plan.uncertainty().admissible_fraction()
                               : document_.plan.coverage().coverage();
    if (auto status = FindBound(scans, settled); !status.ok()) return status;
    if (auto status = PlanWithBound(); !status.ok() || InterruptFlag()) return status;
    if (result_.stop_reason != StopReason::kGoalReached) return absl::OkStatus();
    scans.clear();
    for (const ChosenScan& scan : result_.scans) scans.push_back(scan.measurement);
    return TakeIntoAccount(*session_.oracle, request_.domain, scans, *bound_);
  }

  // Every start of this part, one after the other. The best of all starts becomes the plan, unless
  // this is a part of them: then their results stay in the checkpoint.
  absl::Status SearchFromAllStarts(SearchCheckpoint& checkpoint) {
    std::vector<StartResult> starts;
    size_t best = 0;
    for (int i = part_.number - 1; i < options_.starts.count; i += part_.count) {
      // After an interruption the starts planned so far are kept, so that there is a plan.
      if (InterruptFlag() && !starts.empty()) break;
      auto start = SearchFromStart(i, checkpoint);
      if (!start.ok()) return start.status();
      starts.push_back(*std::move(start));
      if (!part_.IsWhole()) continue;
      if (starts.size() > 1 && !IsBetterStart(starts.back(), starts[best])) continue;
      best = starts.size() - 1;
      if (auto status = TakeStart(starts[best]); !status.ok()) return status;
      if (auto status = WritePlan(); !status.ok()) return status;
    }
    time_to_plan_s_ = SecondsSince(start_);
    if (!part_.IsWhole()) return absl::OkStatus();
    // Starts that came after it have left theirs.
    if (auto status = TakeStart(starts[best]); !status.ok()) return status;
    SetStarts(starts, document_.plan);
    return absl::OkStatus();
  }

  absl::StatusOr<StartResult> SearchFromStart(int index, SearchCheckpoint& checkpoint) {
    const int count = options_.starts.count;
    request_.seed = options_.seed + index;
    if (auto kept = checkpoint.ResultOf(request_.seed)) return *std::move(kept);
    const double begin = kPlanningPhase.begin;
    const double width = kLeastTimePhase.end - begin;
    search_phase_ = {begin + width * index / count, begin + width * (index + 1) / count};
    search_name_ = absl::StrFormat("start %d of %d: ", index + 1, count);
    const std::string name = absl::StrCat("-", request_.seed);
    bound_.reset();
    if (auto status = checkpoint.KeepAnswers(name, &session_); !status.ok()) return status;
    const absl::Status searched = Search();
    checkpoint.LeaveAnswers(&session_);
    if (!searched.ok()) return searched;
    StartResult start = StartOf(result_, document_.plan, bound_);
    // A search that was broken off is to go on another time.
    if (InterruptFlag()) return start;
    if (auto status = checkpoint.KeepResult(start, name); !status.ok()) return status;
    return start;
  }

  // document_ and bound_ of a search that has ended, here or elsewhere.
  absl::Status TakeStart(const StartResult& start) {
    auto scans = ScansOfStart(session_, start);
    if (!scans.ok()) return scans.status();
    auto made = MakePlanDocument(
        session_, *std::move(scans),
        {options_.strategy, start.seed, start.evaluations, StopReasonToProto(start.stop_reason)});
    if (!made.ok()) return made.status();
    document_ = *std::move(made);
    bound_ = start.bound;
    return absl::OkStatus();
  }

  absl::Status Plan(const PlannerRequest& request) {
    Enter(kPlanningPhase);
    const auto plan_start = std::chrono::steady_clock::now();
    auto result = options_.pareto.front ? PlanFront(session_, request, progress_, &options_.output)
                                        : MakePlan(*session_.oracle, request);
    progress_.Finish();
    if (!result.ok()) return result.status();
    result_ = *std::move(result);
    planning_s_ = SecondsSince(plan_start);
    AddTiming(search_name_ + "planning", planning_s_);
    time_to_plan_s_ = SecondsSince(start_);
    return Describe();
  }

  // plan.json appears as soon as there is a plan, and again when there is a better one.
  absl::Status Describe() {
    auto made = MakePlanDocument(session_, result_.scans,
                                 {options_.strategy, request_.seed, result_.evaluations,
                                  StopReasonToProto(result_.stop_reason)});
    if (!made.ok()) return made.status();
    document_ = *std::move(made);
    // With several searches only the best is written.
    if (options_.starts.Several()) return absl::OkStatus();
    if (!earlier_.files.empty()) {
      if (auto status = DescribeAsMeasured(earlier_, session_, &document_); !status.ok()) {
        return status;
      }
    }
    return WritePlan();
  }

  absl::Status WritePlan() {
    // Settings of an earlier plan's scans; with --optics they are made anew.
    const std::string& folder = options_.output.folder;
    if (auto status = RemoveFiles(folder, {"optics.json", "optics.html", "optics_report.json"});
        !status.ok()) {
      return status;
    }
    return WritePlanJson(document_, folder);
  }

  // Bounds the number of scans for the fraction that `scans` satisfy, at most the goal.
  absl::Status FindBound(std::span<const Measurement> scans, double settled) {
    const auto bound_start = std::chrono::steady_clock::now();
    Enter(kBoundPhase);
    auto bound = BoundScanCount(
        *session_.oracle, request_.domain, std::min(GoalFraction(request_.goal), settled), scans,
        options_.bound_evaluations, request_.seed,
        [&](const ScanCountBoundProgress& p) {
          Show(static_cast<double>(p.evaluations) / static_cast<double>(p.budget),
               absl::StrFormat("relaxation so far: %.2f scans", p.bound));
        },
        &InterruptFlag());
    progress_.Finish();
    if (!bound.ok()) return bound.status();
    bound_ = *std::move(bound);
    AddTiming(search_name_ + "lower bound", SecondsSince(bound_start));
    return absl::OkStatus();
  }

  absl::Status PlanWithBound() {
    PlannerRequest request = request_;
    if (request.goal.max_time_s) {
      *request.goal.max_time_s -= planning_s_;
      if (*request.goal.max_time_s <= 0) return absl::OkStatus();
    }
    if (InterruptFlag()) return absl::OkStatus();
    const auto again_start = std::chrono::steady_clock::now();
    Enter(kAgainPhase);
    const size_t before = result_.scans.size();
    auto result = PlanWithGeneratedColumns(*session_.oracle, request, std::move(result_), *bound_);
    progress_.Finish();
    if (!result.ok()) return result.status();
    result_ = *std::move(result);
    AddTiming(search_name_ + "planning with the bound's scans", SecondsSince(again_start));
    return result_.scans.size() < before ? Describe() : absl::OkStatus();
  }

  absl::Status PlanOptically() {
    const auto optics_start = std::chrono::steady_clock::now();
    const auto optics = PlanWithOptics({options_.session, options_.output.folder,
                                        options_.optics_rounds, options_.seed, options_.worker},
                                       request_, &session_, &document_);
    if (!optics.ok()) return optics.status();
    AddTiming("planning with optics", SecondsSince(optics_start));
    return WriteOptics(*optics, options_.output.folder, &document_.plan);
  }

  PlanOptions& options_;
  const Shard part_;  // of the starts
  const EarlierPlan& earlier_;
  const std::optional<SearchQuestion> question_;  // set if answers are kept
  PlanningSession& session_;
  PlannerRequest request_;
  std::chrono::steady_clock::time_point start_;
  ProgressLine progress_;
  ProgressPhase search_phase_{kPlanningPhase.begin, kLeastTimePhase.end};
  std::string search_name_;  // of several: before all that is shown of a search
  PlannerResult result_;
  PlanDocument document_;
  std::optional<ScanCountBoundResult> bound_;
  double planning_s_ = 0, time_to_plan_s_ = 0;
  std::chrono::steady_clock::time_point search_start_;
};

// Everything that the answers kept by --checkpoint depend on; unset without this option.
absl::StatusOr<std::optional<SearchQuestion>> QuestionOf(const PlanOptions& options) {
  if (options.checkpoint.empty()) return std::nullopt;
  auto files = FilesOfInspection(options.session.inspection_file);
  if (!files.ok()) return files.status();
  for (const std::string& file : options.measured.files) {
    // The name may say which scan has measured the points.
    files->push_back(
        {absl::StrCat("--measured ", std::filesystem::path(file).filename().string()), file});
  }
  if (!options.measured.pose_file.empty()) files->push_back({"--pose", options.measured.pose_file});
  auto contents = FileContents::Of(*std::move(files));
  if (!contents.ok()) return contents.status();
  const AsMeasuredOptions& m = options.measured;
  return SearchQuestion{
      *std::move(contents),
      m.files.empty()
          ? ""
          : absl::StrFormat("pose prior %s mm, %s deg; tolerated distance %s mm; unit %s",
                            NumberText(m.pose_prior_mm), NumberText(m.pose_prior_deg),
                            NumberText(m.tolerated_distance_mm), m.unit)};
}

absl::Status PlanParsed(PlanOptions& options, const Shard& part) {
  PlannerRequest request;
  if (auto status = ReadGivenScans(options, request); !status.ok()) return status;
  if (auto status = CheckStrategy(options.strategy); !status.ok()) return status;
  const auto earlier = ReadMeasuredScans(options, request);
  if (!earlier.ok()) return earlier.status();
  const bool measured = !earlier->files.empty();
  if (measured) options.session.before_upload = PutMeasuredPart(options.measured, *earlier);
  if (auto status = CheckOptics(options); !status.ok()) return status;
  options.session.kept_scans = request.locked;
  // Parts of the starts leave the folder to the run that chooses.
  std::optional<FileLock> out_lock;
  if (part.IsWhole()) {
    auto taken = OpenOutputFolder(options.output.folder);
    if (!taken.ok()) return taken.status();
    out_lock = *std::move(taken);
  }
  const auto start = std::chrono::steady_clock::now();
  auto question = QuestionOf(options);
  if (!question.ok()) return question.status();
  auto session = OpenSession(options.session);
  if (!session.ok()) return session.status();
  if (measured) {
    if (auto status = AskMeasuredPoints(*earlier, &*session); !status.ok()) return status;
  }
  Planning planning(options, std::move(request), part, *earlier, *std::move(question), *session,
                    start);
  if (auto status = planning.Run(); !status.ok()) return status;
  planning.Print();
  return absl::OkStatus();
}

int RunPlan(PlanOptions& options) {
  const char* other = options.optics                    ? "--optics"
                      : !options.measured.files.empty() ? "--measured"
                                                        : "";
  if (absl::Status s = CheckParetoOptions(options.pareto, options.strategy, other); !s.ok()) {
    return ReportError(s);
  }
  const auto part =
      CheckStartsOptions(options.starts, options.seed, options.checkpoint,
                         options.pareto.front || options.pareto.Picks() ? "--pareto" : other);
  if (!part.ok()) return ReportError(part.status());
  if (options.pareto.Picks()) {
    return RunPick(options.session, options.pareto.pick, options.output);
  }
  if (absl::Status s = PlanParsed(options, *part); !s.ok()) return ReportError(s);
  return InterruptFlag() ? kExitInterrupted : kExitDone;
}

}  // namespace

Command AddPlanCommand(CLI::App& app) {
  auto options = std::make_shared<PlanOptions>();
  app.add_option("inspection", options->session.inspection_file, "inspection.json")->required();
  app.add_option("--out", options->output.folder, "folder for plan.json, report.html, ...")
      ->required();
  std::vector<std::string> strategies;
  for (const StrategyDescription& known : Strategies()) strategies.push_back(known.name);
  app.add_option("--strategy", options->strategy, absl::StrJoin(strategies, ", "));
  app.add_option("--seed", options->seed, "same seed, same plan");
  app.add_option(
         "--goal", options->goal,
         "fraction of the targets to cover (or to know with admissible uncertainty, if that is "
         "the inspection's goal); overrides the inspection's")
      ->check(CLI::Range(1e-6, 1.0));
  app.add_option("--max-scans", options->max_scans, "overrides the inspection's")
      ->check(CLI::Range(1, 1000));
  app.add_option("--max-time-s", options->max_time_s, "wall-clock limit")
      ->check(CLI::PositiveNumber);
  app.add_option("--goal-time-s", options->goal_time_s,
                 "longest time to execute the plan, by the inspection's costs; the plan satisfies "
                 "as many targets as it can in that time")
      ->check(CLI::PositiveNumber);
  app.add_option("--max-setups", options->max_setups,
                 "most set-ups: resting faces with places of the sensors")
      ->check(CLI::Range(1, 1000));
  app.add_option("--max-sensor-places", options->max_sensor_places, "most places of the sensors")
      ->check(CLI::Range(1, 1000));
  app.add_option("--max-resting-faces", options->max_resting_faces,
                 "most faces that the part is laid on")
      ->check(CLI::Range(1, 1000));
  app.add_option("--keep", options->keep,
                 "plan.json whose scans stay as they are; the rest is planned");
  app.add_flag("--resume", options->resume, "go on from the plan.json in --out");
  AddOtherPartOption(app, &options->session.plans.other_part);
  AddAsMeasuredOptions(app, &options->measured);
  AddParetoOptions(app, &options->pareto);
  AddStartsOptions(app, &options->starts);
  app.add_option("--checkpoint", options->checkpoint,
                 "folder for a checkpoint: after an interruption the same command with the same "
                 "folder goes on and makes the same plan");
  app.add_option("--evaluations-per-scan", options->evaluations_per_scan,
                 "gain evaluations per scan")
      ->check(CLI::Range(1, 100000000));
  app.add_option("--matrix-samples", options->matrix_samples, "samples of the measurability matrix")
      ->check(CLI::Range(1, 20000000));
  app.add_option("--bound-evaluations", options->bound_evaluations,
                 "budget of the lower bound, 0: none")
      ->check(CLI::Range(0, 100000000));
  app.add_flag("--optics", options->optics,
               "plan geometry and settings in turn: learn line detection from rendered images, and "
               "write each scan's setting of camera and laser");
  app.add_option("--optics-rounds", options->optics_rounds,
                 "most times that geometry and setting are planned in turn")
      ->check(CLI::Range(1, 20));
  AddWorkerOptions(app, &options->worker);
  app.add_flag("!--no-fresh-targets", options->session.fresh_targets,
               "score the plan on its own targets only");
  app.add_option("--coverage-server", options->session.coverage_server,
                 "unix:PATH or HOST:PORT; default: an embedded server");
  app.add_option("--field-directions", options->session.field_directions,
                 "directions of the visibility field")
      ->check(CLI::Range(64, 65536));
  app.add_flag("!--no-pictures", options->output.pictures,
               "leave the rendered views out of the report");
  app.add_flag("!--no-point-clouds", options->output.point_clouds,
               "do not write points/scan_NN.ply");
  app.add_flag("--ellipsoids", options->output.ellipsoids,
               "for uncertainty: write points/scan_NN_ellipsoids.ply too");
  NeedOption(app, {"--optics-rounds", "--render-worker", "--threads"}, "--optics");
  return [&app, options] {
    // A point of the front has been planned before.
    for (const char* pick : {"--pick", "--pick-scans", "--pick-seconds"}) {
      absl::Status status =
          CheckExcluded(app, pick,
                        {"--strategy", "--seed", "--goal", "--max-scans", "--max-time-s",
                         "--goal-time-s", "--max-setups", "--max-sensor-places",
                         "--max-resting-faces", "--keep", "--resume", "--starts", "--checkpoint",
                         "--evaluations-per-scan", "--matrix-samples", "--bound-evaluations"});
      if (!status.ok()) return ReportError(status);
    }
    if (app.count("--matrix-samples") > 0 && options->strategy != kMatrixStrategy) {
      PrintTextTo(stderr, "warning: --matrix-samples has no effect without --strategy %s\n",
                  kMatrixStrategy);
    }
    GiveBothServersTls(options->session.coverage_server, &options->session.tls,
                       options->worker.address, &options->worker.tls);
    return RunPlan(*options);
  };
}

}  // namespace sightline
