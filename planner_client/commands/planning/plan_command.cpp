#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/exit_code.h"
#include "planner_client/commands/interrupt.h"
#include "planner_client/commands/part_assets.h"
#include "planner_client/commands/planning/plan_document.h"
#include "planner_client/commands/planning/planning_session.h"
#include "planner_client/commands/progress_line.h"
#include "planner_client/plan_oracle/journalled_oracle.h"
#include "planner_client/rpc_client/sha256.h"

namespace sightline {
namespace {

// Of the whole command, by how long the example head takes; opening the session comes before, the
// outputs after.
constexpr ProgressPhase kPlanningPhase{kOpenSessionPhase.end, 0.85};
constexpr ProgressPhase kBoundPhase{0.85, 0.95};

struct PlanOptions {
  SessionOptions session;
  OutputOptions output;
  std::string strategy = "refined";
  std::string keep;
  std::string checkpoint;
  bool resume = false;
  int64_t seed = 1;
  std::optional<double> goal;
  std::optional<int> max_scans;
  std::optional<double> max_time_s;
  int64_t evaluations_per_scan = 10000;
  int64_t matrix_samples = 1500000;
  int64_t bound_evaluations = 100000;
};

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// Wrong input is found before the scene is built, which takes seconds.
absl::Status ReadGivenScans(const PlanOptions& options, PlannerRequest& request) {
  if (!options.keep.empty()) {
    auto kept = ReadPlanScans(options.keep);
    if (!kept.ok()) return kept.status();
    request.locked = std::move(kept->all);
  }
  if (options.resume) {
    const std::string path = options.output.folder + "/plan.json";
    auto earlier = ReadPlanScans(path);
    if (!earlier.ok()) return earlier.status();
    for (size_t i = 0; i < earlier->all.size(); ++i) {
      (earlier->locked[i] ? request.locked : request.starting).push_back(earlier->all[i]);
    }
  }
  return absl::OkStatus();
}

// Keeps what the coverage server answers in a file of the folder, and first takes from there what
// it answered an earlier run of the same task that was broken off.
absl::Status KeepAnswers(const std::string& folder, PlanningSession* session,
                         const std::string& inspection_file) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return absl::InternalError(absl::StrCat(folder, ": ", error.message()));
  const auto inspection = ReadFile(inspection_file);
  if (!inspection.ok()) return inspection.status();
  // Another build may answer otherwise.
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  const auto built = std::filesystem::last_write_time(program, error).time_since_epoch().count();
  Sha256 fingerprint;
  fingerprint.Add(*inspection);
  fingerprint.Add(session->client->scene().scene_digest);
  if (session->fresh_client) fingerprint.Add(session->fresh_client->scene().scene_digest);
  fingerprint.Add(absl::StrCat(SIGHTLINE_VERSION, " ", built));
  auto journal =
      JournalledOracle::Open(std::move(session->oracle), folder + "/answers", fingerprint.Hex());
  if (!journal.ok()) return journal.status();
  session->oracle = *std::move(journal);
  return absl::OkStatus();
}

int RunPlan(PlanOptions& options) {
  const std::atomic<bool>& interrupted = InterruptFlag();
  PlannerRequest request;
  if (absl::Status status = ReadGivenScans(options, request); !status.ok())
    return ReportError(status);
  if (absl::Status status = CheckStrategy(options.strategy); !status.ok()) {
    return ReportError(status);
  }
  const auto start = std::chrono::steady_clock::now();
  auto session = OpenSession(options.session);
  if (!session.ok()) return ReportError(session.status());
  const SceneInfo& scene = session->client->scene();
  auto& timings = options.output.timings;
  timings.push_back({"target points", scene.targets_time_s});
  timings.push_back({"visibility data", scene.field_time_s});
  timings.push_back({"measurability", scene.measurability_time_s});
  timings.push_back({"loading, upload and start of the server",
                     session->open_time_s - scene.targets_time_s - scene.field_time_s -
                         scene.measurability_time_s});

  PlanningGoal& goal = session->inspection.goal;
  if (options.goal) (goal.admissible ? *goal.admissible : goal.coverage) = *options.goal;
  if (options.max_scans) session->inspection.goal.max_scans = *options.max_scans;
  if (options.max_time_s) session->inspection.goal.max_time_s = *options.max_time_s;
  request.domain = session->inspection.domain;
  request.goal = goal;
  request.strategy = options.strategy;
  request.seed = options.seed;
  request.evaluations_per_scan = options.evaluations_per_scan;
  request.matrix_samples = options.matrix_samples;
  request.with_curves = false;
  request.interrupted = &interrupted;
  if (!options.checkpoint.empty()) {
    absl::Status kept = KeepAnswers(options.checkpoint, &*session, options.session.inspection_file);
    if (!kept.ok()) return ReportError(kept);
  }
  ProgressLine progress(kPlanningPhase);
  request.on_progress = [&](const PlanProgress& p) {
    progress.Show(
        p.coverage / p.goal,
        absl::StrFormat("%d scans, %.1f %% %s, %dk evaluations: %s", p.scans, 100 * p.coverage,
                        session->ForUncertainty() ? "admissible" : "covered", p.evaluations / 1000,
                        p.phase));
  };
  const auto plan_start = std::chrono::steady_clock::now();
  auto result = MakePlan(*session->oracle, request);
  progress.Finish();
  if (!result.ok()) return ReportError(result.status());
  timings.push_back({"planning", SecondsSince(plan_start)});
  const double time_to_plan_s = SecondsSince(start);

  PlanSource source{options.strategy, options.seed, result->evaluations,
                    StopReasonToProto(result->stop_reason)};
  auto made = MakePlanDocument(*session, std::move(result->scans), source);
  if (!made.ok()) return ReportError(made.status());
  PlanDocument& document = *made;
  if (absl::Status status = WritePlanJson(document, options.output.folder); !status.ok())
    return ReportError(status);

  if (options.bound_evaluations > 0 && !interrupted.load() && !document.scans.empty()) {
    const auto bound_start = std::chrono::steady_clock::now();
    progress.Enter(kBoundPhase);
    std::vector<Measurement> scans;
    for (const ChosenScan& scan : document.scans) scans.push_back(scan.measurement);
    const double reached = session->ForUncertainty()
                               ? document.plan.uncertainty().admissible_fraction()
                               : document.plan.coverage().coverage();
    auto bound = BoundScanCount(
        *session->oracle, request.domain, std::min(GoalFraction(request.goal), reached), scans,
        options.bound_evaluations, options.seed,
        [&](const ScanCountBoundProgress& p) {
          progress.Show(static_cast<double>(p.evaluations) / static_cast<double>(p.budget),
                        absl::StrFormat("lower bound so far: %.2f scans", p.bound));
        },
        &interrupted);
    progress.Finish();
    if (!bound.ok()) return ReportError(bound.status());
    SetBound(*bound, document.plan);
    timings.push_back({"lower bound", SecondsSince(bound_start)});
  }
  if (absl::Status status = WritePlanOutputs(*session, document, options.output); !status.ok())
    return ReportError(status);
  std::printf("%s%.1f s from cold start to plan.\n", SummarisePlan(document.plan).c_str(),
              time_to_plan_s);
  std::printf("plan:   %s\nreport: %s\n",
              std::filesystem::absolute(options.output.folder + "/plan.json").c_str(),
              std::filesystem::absolute(options.output.folder + "/report.html").c_str());
  return interrupted.load() ? kExitInterrupted : kExitDone;
}

}  // namespace

Command AddPlanCommand(CLI::App& app) {
  auto options = std::make_shared<PlanOptions>();
  app.add_option("inspection", options->session.inspection_file, "inspection.json")->required();
  app.add_option("--out", options->output.folder, "folder for plan.json, report.html, ...")
      ->required();
  app.add_option("--strategy", options->strategy,
                 "refined, greedy-pso, greedy-ga, greedy-sa, matrix, ...");
  app.add_option("--seed", options->seed, "same seed, same plan");
  app.add_option("--goal", options->goal,
                 "fraction of the targets to be covered (or known admissibly, if the inspection's "
                 "goal is that), overrides the inspection's")
      ->check(CLI::Range(1e-6, 1.0));
  app.add_option("--max-scans", options->max_scans, "overrides the inspection's")
      ->check(CLI::Range(1, 1000));
  app.add_option("--max-time-s", options->max_time_s, "wall-clock limit")
      ->check(CLI::PositiveNumber);
  app.add_option("--keep", options->keep,
                 "plan.json whose scans stay as they are; the rest is planned");
  app.add_flag("--resume", options->resume, "go on from the plan.json in --out");
  app.add_option("--checkpoint", options->checkpoint,
                 "folder for what is needed to go on after the process was ended; the same command "
                 "with the same folder makes the plan of an unbroken run");
  app.add_option("--evaluations-per-scan", options->evaluations_per_scan,
                 "gain evaluations per scan")
      ->check(CLI::Range(1, 100000000));
  app.add_option("--matrix-samples", options->matrix_samples, "samples of the measurability matrix")
      ->check(CLI::Range(1, 20000000));
  app.add_option("--bound-evaluations", options->bound_evaluations,
                 "budget of the lower bound, 0: none")
      ->check(CLI::Range(0, 100000000));
  app.add_flag("!--no-fresh-targets", options->session.fresh_targets,
               "score the plan on its own targets only");
  app.add_option("--coverage-server", options->session.coverage_server,
                 "unix:PATH or HOST:PORT; default: one of our own");
  app.add_option("--field-directions", options->session.field_directions,
                 "directions of the visibility field")
      ->check(CLI::Range(64, 65536));
  app.add_flag("!--no-pictures", options->output.pictures,
               "leave the rendered views out of the report");
  app.add_flag("!--no-point-clouds", options->output.point_clouds,
               "do not write points/scan_NN.ply");
  app.add_flag("--ellipsoids", options->output.ellipsoids,
               "for uncertainty: write points/scan_NN_ellipsoids.ply too");
  return [options] { return RunPlan(*options); };
}

}  // namespace sightline
