#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/json/strict_json.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/exit_code.h"
#include "planner_client/commands/interrupt.h"
#include "planner_client/commands/plan_document.h"
#include "planner_client/commands/planning_session.h"
#include "planner_client/commands/progress_line.h"

namespace sightline {
namespace {

struct CompareOptions {
  SessionOptions session;
  OutputOptions output;
  std::vector<std::string> strategies;
  std::vector<double> goals = {0.9, 0.95};
  int seeds = 5;
  int64_t evaluations_per_scan = 10000;
  int64_t matrix_samples = 1500000;
};

// Scans by strategy, goal and seed; 0: goal not reached.
struct Run {
  std::string strategy;
  std::vector<std::vector<int>> scans;
  std::vector<double> seconds;
  int64_t evaluations = 0;
};

StrategyComparison::Scans Summarise(std::vector<int> counts) {
  std::erase(counts, 0);
  StrategyComparison::Scans scans;
  scans.seeds_reached = static_cast<int>(counts.size());
  if (counts.empty()) return scans;
  std::sort(counts.begin(), counts.end());
  const size_t n = counts.size();
  scans.median = n % 2 == 1 ? counts[n / 2] : 0.5 * (counts[n / 2 - 1] + counts[n / 2]);
  scans.min = counts.front();
  scans.max = counts.back();
  return scans;
}

int RunCompare(CompareOptions& options) {
  const std::atomic<bool>& interrupted = InterruptFlag();
  for (const std::string& strategy : options.strategies) {
    if (absl::Status status = CheckStrategy(strategy); !status.ok()) return ReportError(status);
  }
  auto session = OpenSession(options.session);
  if (!session.ok()) return ReportError(session.status());
  std::sort(options.goals.begin(), options.goals.end());
  if (options.strategies.empty()) {
    for (const StrategyDescription& strategy : Strategies())
      options.strategies.push_back(strategy.name);
  }
  std::vector<Run> runs;
  PlannerResult best;
  std::string best_strategy;
  int64_t best_seed = 0;
  std::string csv = "strategy,goal,seed,scans,coverage,evaluations,time_s\n";
  ProgressLine progress;
  for (const std::string& strategy : options.strategies) {
    Run run{strategy, std::vector<std::vector<int>>(options.goals.size()), {}, 0};
    // Greedy plans grow scan by scan: one run to the highest goal holds the answer for all. Other
    // strategies are told the goal they are to reach.
    const bool greedy = strategy != "refined";
    for (int seed = 1; seed <= options.seeds && !interrupted.load(); ++seed) {
      for (size_t g = greedy ? options.goals.size() - 1 : 0;
           g < options.goals.size() && !interrupted.load(); ++g) {
        PlannerRequest request;
        request.domain = session->inspection.domain;
        request.goal = session->inspection.goal;
        request.goal.coverage = options.goals[g];
        request.strategy = strategy;
        request.seed = seed;
        request.evaluations_per_scan = options.evaluations_per_scan;
        request.matrix_samples = options.matrix_samples;
        request.interrupted = &interrupted;
        request.on_progress = [&](const PlanProgress& p) {
          progress.Show(p.coverage / p.goal,
                        absl::StrFormat("%s, seed %d: %d scans, %.1f %%", strategy, seed, p.scans,
                                        100 * p.coverage));
        };
        const auto start = std::chrono::steady_clock::now();
        auto result = MakePlan(*session->client, request);
        if (!result.ok()) return ReportError(result.status());
        const double seconds =
            std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        run.seconds.push_back(seconds);
        run.evaluations += result->evaluations;
        for (size_t k = greedy ? 0 : g; k <= g; ++k) {
          const auto& curve = result->coverage_curve;
          const auto reached = std::find_if(curve.begin(), curve.end(),
                                            [&](double c) { return c >= options.goals[k]; });
          const int scans =
              reached == curve.end() ? 0 : static_cast<int>(reached - curve.begin()) + 1;
          run.scans[k].push_back(scans);
          absl::StrAppendFormat(&csv, "%s,%g,%d,%d,%.6f,%d,%.2f\n", strategy, options.goals[k],
                                seed, scans, curve.empty() ? 0 : curve.back(), result->evaluations,
                                seconds);
        }
        const bool reaches = result->stop_reason == StopReason::kGoalReached;
        if (g + 1 == options.goals.size() && reaches &&
            (best.scans.empty() || result->scans.size() < best.scans.size())) {
          best = std::move(*result);
          best_strategy = strategy;
          best_seed = seed;
        }
      }
    }
    runs.push_back(std::move(run));
  }
  progress.Finish();

  ComparisonTable table{options.goals, {}};
  std::printf("%-14s", "strategy");
  for (const double goal : options.goals) std::printf("  scans for %4.4g %%  ", 100 * goal);
  std::printf("  time per plan\n");
  for (const Run& run : runs) {
    StrategyComparison row{run.strategy, options.seeds, {}};
    std::printf("%-14s", run.strategy.c_str());
    for (const auto& counts : run.scans) {
      row.scans.push_back(Summarise(counts));
      const auto& s = row.scans.back();
      if (s.seeds_reached == 0) {
        std::printf("  %-18s", "not reached");
      } else {
        std::printf("  %-18s",
                    absl::StrFormat("%g (%d-%d)%s", s.median, s.min, s.max,
                                    s.seeds_reached < options.seeds
                                        ? absl::StrFormat(" %d/%d", s.seeds_reached, options.seeds)
                                        : "")
                        .c_str());
      }
    }
    double total = 0;
    for (const double s : run.seconds) total += s;
    std::printf("  %.1f s\n",
                run.seconds.empty() ? 0.0 : total / static_cast<double>(run.seconds.size()));
    table.strategies.push_back(std::move(row));
  }
  options.output.comparison = table;
  options.output.point_clouds = false;
  std::error_code error;
  std::filesystem::create_directories(options.output.folder, error);
  if (absl::Status status = WriteFileAtomically(options.output.folder + "/comparison.csv", csv);
      !status.ok())
    return ReportError(status);
  if (!best.scans.empty()) {
    session->inspection.goal.coverage = options.goals.back();
    PlanSource source{best_strategy, best_seed, best.evaluations,
                      StopReasonToProto(best.stop_reason)};
    const PlanDocument document = MakePlanDocument(*session, std::move(best.scans), source);
    if (absl::Status status = WritePlanOutputs(*session, document, options.output); !status.ok())
      return ReportError(status);
    std::printf("best plan and table: %s\n",
                std::filesystem::absolute(options.output.folder + "/report.html").c_str());
  }
  std::printf("all runs: %s\n",
              std::filesystem::absolute(options.output.folder + "/comparison.csv").c_str());
  return interrupted.load() ? kExitInterrupted : kExitDone;
}

}  // namespace

Command AddCompareCommand(CLI::App& app) {
  auto options = std::make_shared<CompareOptions>();
  app.add_option("inspection", options->session.inspection_file, "inspection.json")->required();
  app.add_option("--out", options->output.folder,
                 "folder for comparison.csv and the best plan's report")
      ->required();
  app.add_option("--strategies", options->strategies, "default: all")->delimiter(',');
  app.add_option("--goals", options->goals, "coverage goals")
      ->delimiter(',')
      ->check(CLI::Range(1e-6, 1.0));
  app.add_option("--seeds", options->seeds, "runs per strategy")->check(CLI::Range(1, 1000));
  app.add_option("--evaluations-per-scan", options->evaluations_per_scan,
                 "gain evaluations per scan")
      ->check(CLI::Range(1, 100000000));
  app.add_option("--matrix-samples", options->matrix_samples, "samples of the measurability matrix")
      ->check(CLI::Range(1, 20000000));
  app.add_option("--coverage-server", options->session.coverage_server,
                 "unix:PATH or HOST:PORT; default: one of our own");
  return [options] { return RunCompare(*options); };
}

}  // namespace sightline
