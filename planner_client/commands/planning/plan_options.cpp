// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/planning/plan_options.h"

#include <vector>

#include "absl/strings/str_join.h"
#include "core/command_options/option_values.h"
#include "core/status/status_macros.h"
#include "planner_client/command_line/process/interrupt.h"
#include "planner_client/commands/other_part.h"

namespace sightline {

void AddPlanOptions(CLI::App& app, PlanOptions* options) {
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
  NeedOption(app, {"--optics-rounds"}, "--optics");
}

absl::Status CheckPickAlone(const CLI::App& app) {
  for (const char* pick : {"--pick", "--pick-scans", "--pick-seconds"}) {
    SIGHTLINE_RETURN_IF_ERROR(
        CheckExcluded(app, pick,
                      {"--strategy", "--seed", "--goal", "--max-scans", "--max-time-s",
                       "--goal-time-s", "--max-setups", "--max-sensor-places",
                       "--max-resting-faces", "--keep", "--resume", "--starts", "--checkpoint",
                       "--evaluations-per-scan", "--matrix-samples", "--bound-evaluations"}));
  }
  return absl::OkStatus();
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

void SetOptions(const PlanOptions& options, PlannerRequest& request) {
  request.strategy = options.strategy;
  request.seed = options.seed;
  request.evaluations_per_scan = options.evaluations_per_scan;
  request.matrix_samples = options.matrix_samples;
  request.with_curves = false;
  request.interrupted = &InterruptFlag();
}

}  // namespace sightline
