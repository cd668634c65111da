// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/file/atomic_write.h"
#include "core/text/number.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/interrupt.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/command_line/process/progress_line.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/planning/document/plan_document.h"
#include "planner_client/commands/planning/plan_outputs.h"
#include "planner_client/commands/planning/session/planning_session.h"

namespace sightline {
namespace {

struct CompareOptions {
  SessionOptions session;
  OutputOptions output;
  std::vector<std::string> strategies;
  std::vector<std::string> gains;
  std::vector<double> goals;  // empty: 90 % and 95 % coverage, or the inspection's of uncertainty
  int seeds = 5;
  int64_t evaluations_per_scan = 10000;
  int64_t matrix_samples = 1500000;
};

// Gain functions of the thesis (eq. 6.1, 6.3) and this project's, by name.
absl::StatusOr<GainWeights> GainNamed(const std::string& name) {
  if (name == "tu") return GainWeights{.total_uncertainty = 1};
  if (name == "information") return GainWeights{.information = 1};
  constexpr char kRelaxed[] = "ra:";
  if (name.starts_with(kRelaxed)) {
    const auto alpha = ParseReal(std::string_view(name).substr(sizeof(kRelaxed) - 1));
    if (alpha.ok() && *alpha >= 0 && *alpha <= 1) {
      return GainWeights{.admissible = *alpha, .relaxed = 1 - *alpha};
    }
  }
  return absl::InvalidArgumentError(
      absl::StrCat("--gains: \"", name, "\" is none of ra:ALPHA (0 to 1), tu, information, own"));
}

// Scans by strategy, goal and seed; 0: goal not reached.
struct Run {
  std::string strategy;  // with the gain it searches by, if there are several
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
  for (const std::string& strategy : options.strategies) {
    if (absl::Status status = CheckStrategy(strategy); !status.ok()) return ReportError(status);
  }
  // A strategy with the gain it searches by; without --gains that of the inspection.
  struct Variant {
    std::string label;
    std::string strategy;
    std::optional<GainWeights> gain;
  };
  std::vector<std::optional<GainWeights>> gains;
  for (const std::string& name : options.gains) {
    if (name == "own") {
      gains.push_back(PlanningGoal{}.gain);
      continue;
    }
    auto gain = GainNamed(name);
    if (!gain.ok()) return ReportError(gain.status());
    gains.push_back(*gain);
  }
  const auto out_lock = OpenOutputFolder(options.output.folder);
  if (!out_lock.ok()) return ReportError(out_lock.status());
  auto session = OpenSession(options.session);
  if (!session.ok()) return ReportError(session.status());
  const std::atomic<bool>& interrupted = InterruptFlag();
  if (!gains.empty() && !session->ForUncertainty()) {
    return ReportError(absl::InvalidArgumentError(
        absl::StrCat("--gains: ", options.session.inspection_file, " has no goal.admissible")));
  }
  if (options.goals.empty()) {
    options.goals = session->ForUncertainty()
                        ? std::vector<double>{*session->inspection.goal.admissible}
                        : std::vector<double>{0.9, 0.95};
  }
  std::sort(options.goals.begin(), options.goals.end());
  if (options.strategies.empty()) {
    for (const StrategyDescription& strategy : Strategies())
      options.strategies.push_back(strategy.name);
  }
  std::vector<Variant> variants;
  for (const std::string& strategy : options.strategies) {
    if (gains.empty()) variants.push_back({strategy, strategy, std::nullopt});
    for (size_t i = 0; i < gains.size(); ++i) {
      variants.push_back({absl::StrCat(strategy, " ", options.gains[i]), strategy, gains[i]});
    }
  }
  std::vector<Run> runs;
  PlannerResult best;
  std::string best_strategy;
  int64_t best_seed = 0;
  std::string csv = "strategy,goal,seed,scans,coverage,evaluations,time_s\n";
  std::string curves = "strategy,seed,scans,settled,relaxed\n";
  ProgressLine progress;
  for (const Variant& variant : variants) {
    const std::string& strategy = variant.strategy;
    if (variant.gain) {
      absl::Status status = session->gain_model->SetWeights(*variant.gain);
      if (!status.ok()) return ReportError(status);
    }
    Run run{variant.label, std::vector<std::vector<int>>(options.goals.size()), {}, 0};
    // If plans grow scan by scan, one run to the highest goal answers all goals. Other strategies
    // get each goal separately.
    const bool scan_by_scan = std::any_of(
        Strategies().begin(), Strategies().end(),
        [&](const auto& known) { return known.name == strategy && known.scan_by_scan; });
    for (int seed = 1; seed <= options.seeds && !interrupted.load(); ++seed) {
      for (size_t g = scan_by_scan ? options.goals.size() - 1 : 0;
           g < options.goals.size() && !interrupted.load(); ++g) {
        PlannerRequest request;
        request.domain = session->inspection.domain;
        request.goal = session->inspection.goal;
        (request.goal.admissible ? *request.goal.admissible : request.goal.coverage) =
            options.goals[g];
        request.strategy = strategy;
        request.seed = seed;
        request.evaluations_per_scan = options.evaluations_per_scan;
        request.matrix_samples = options.matrix_samples;
        request.interrupted = &interrupted;
        request.on_progress = [&](const PlanProgress& p) {
          progress.Show(p.done, absl::StrFormat("%s, seed %d: %d scans, %.1f %%", variant.label,
                                                seed, p.scans, 100 * p.coverage));
        };
        const auto start = std::chrono::steady_clock::now();
        auto result = MakePlan(*session->gain_model, request);
        if (!result.ok()) return ReportError(result.status());
        // An interrupted plan says nothing about the strategy.
        if (result->stop_reason == StopReason::kInterrupted) break;
        const double seconds =
            std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        run.seconds.push_back(seconds);
        run.evaluations += result->evaluations;
        for (size_t k = scan_by_scan ? 0 : g; k <= g; ++k) {
          const auto& curve = result->coverage_curve;
          const auto reached = std::find_if(curve.begin(), curve.end(),
                                            [&](double c) { return c >= options.goals[k]; });
          const int scans =
              reached == curve.end() ? 0 : static_cast<int>(reached - curve.begin()) + 1;
          run.scans[k].push_back(scans);
          absl::StrAppendFormat(&csv, "%s,%g,%d,%d,%.6f,%d,%.2f\n", variant.label, options.goals[k],
                                seed, scans, curve.empty() ? 0 : curve.back(), result->evaluations,
                                seconds);
        }
        for (size_t k = 0; k < result->coverage_curve.size(); ++k) {
          absl::StrAppendFormat(&curves, "%s,%d,%d,%.6f,%.6f\n", variant.label, seed, k + 1,
                                result->coverage_curve[k], result->relaxed_curve[k]);
        }
        const bool reaches = result->stop_reason == StopReason::kGoalReached;
        if (g + 1 == options.goals.size() && reaches &&
            (best.scans.empty() || result->scans.size() < best.scans.size())) {
          best = std::move(*result);
          best_strategy = variant.label;
          best_seed = seed;
        }
      }
    }
    if (!run.seconds.empty()) runs.push_back(std::move(run));
  }
  progress.Finish();

  ComparisonTable table{options.goals, {}};
  PrintText("%-14s", "strategy");
  for (const double goal : options.goals) PrintText("  scans for %4.4g %%  ", 100 * goal);
  PrintText("  time per plan\n");
  for (const Run& run : runs) {
    const auto seeds = static_cast<int>(run.scans.front().size());
    StrategyComparison row{run.strategy, seeds, {}};
    PrintText("%-14s", run.strategy.c_str());
    for (const auto& counts : run.scans) {
      row.scans.push_back(Summarise(counts));
      const auto& s = row.scans.back();
      if (s.seeds_reached == 0) {
        PrintText("  %-18s", "not reached");
      } else {
        PrintText("  %-18s", absl::StrFormat("%g (%d-%d)%s", s.median, s.min, s.max,
                                             s.seeds_reached < seeds
                                                 ? absl::StrFormat(" %d/%d", s.seeds_reached, seeds)
                                                 : "")
                                 .c_str());
      }
    }
    double total = 0;
    for (const double s : run.seconds) total += s;
    PrintText("  %.1f s\n",
              run.seconds.empty() ? 0.0 : total / static_cast<double>(run.seconds.size()));
    table.strategies.push_back(std::move(row));
  }
  options.output.comparison = table;
  options.output.point_clouds = false;
  for (const auto& [name, text] : {std::pair("comparison.csv", &csv), {"curves.csv", &curves}}) {
    absl::Status status = WriteFileAtomically(options.output.folder + "/" + name, *text);
    if (!status.ok()) return ReportError(status);
  }
  if (!best.scans.empty()) {
    PlanningGoal& goal = session->inspection.goal;
    (goal.admissible ? *goal.admissible : goal.coverage) = options.goals.back();
    PlanSource source{best_strategy, best_seed, best.evaluations,
                      StopReasonToProto(best.stop_reason)};
    auto made = MakePlanDocument(*session, std::move(best.scans), source);
    if (!made.ok()) return ReportError(made.status());
    if (absl::Status status = WritePlanOutputs(*session, *made, options.output); !status.ok())
      return ReportError(status);
    PrintText("best plan and table: %s\n",
              std::filesystem::absolute(options.output.folder + "/report.html").c_str());
  }
  PrintText("all runs: %s\n",
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
  app.add_option(
         "--gains", options->gains,
         "for uncertainty, the gains that searches maximise: ra:ALPHA and tu of the thesis, "
         "information, own; default: the inspection's")
      ->delimiter(',');
  app.add_option("--goals", options->goals,
                 "default: 90 % and 95 % coverage, or the inspection's of uncertainty")
      ->delimiter(',')
      ->check(CLI::Range(1e-6, 1.0));
  app.add_option("--seeds", options->seeds, "runs per strategy")->check(CLI::Range(1, 1000));
  app.add_option("--evaluations-per-scan", options->evaluations_per_scan,
                 "gain evaluations per scan")
      ->check(CLI::Range(1, 100000000));
  app.add_option("--matrix-samples", options->matrix_samples, "samples of the measurability matrix")
      ->check(CLI::Range(1, 20000000));
  app.add_flag("!--no-fresh-targets", options->session.fresh_targets,
               "score plans on their own targets only");
  app.add_option("--coverage-server", options->session.coverage_server,
                 "unix:PATH or HOST:PORT; default: an embedded server");
  AddServerTlsOptions(app, &options->session.tls);
  return [&app, options] {
    const std::vector<std::string>& strategies = options->strategies;
    if (app.count("--matrix-samples") > 0 && !strategies.empty() &&
        std::find(strategies.begin(), strategies.end(), kMatrixStrategy) == strategies.end()) {
      PrintTextTo(stderr, "warning: --matrix-samples has no effect without the strategy %s\n",
                  kMatrixStrategy);
    }
    return RunCompare(*options);
  };
}

}  // namespace sightline
