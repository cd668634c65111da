// SPDX-License-Identifier: Apache-2.0
// Plans of least time beside plans of fewest scans, both with the same limits and costed alike.
//
// Each inspection is planned once, as `sightline plan` does it. The plan of fewest scans is the
// last one before set-ups count; its scans are put in the order of least time like those of the
// other.
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "bench/common/measure.h"
#include "planner_client/commands/planning/session/planning_session.h"
#include "planning/pareto/frame_estimate.h"
#include "planning/strategy/bounded_plan.h"
#include "planning/strategy/scan_order.h"

namespace sightline::bench {
namespace {

struct Options {
  std::vector<std::string> inspections;
  int64_t seed = 1;
  int64_t bound_evaluations = 100000;
  int64_t evaluations_per_scan = 5000;
  std::string json;
};

struct Costed {
  size_t scans = 0;
  SetupCounts counts;
  double scan_s = 0, turn_s = 0, lay_s = 0, move_sensors_s = 0;

  double Total_s() const { return scan_s + turn_s + lay_s + move_sensors_s; }
};

Costed CostOf(const ExecutionModel& model, const PlannerResult& plan) {
  std::vector<Measurement> scans;
  Costed costed;
  for (const ChosenScan& scan : plan.scans) {
    scans.push_back(scan.measurement);
    costed.scan_s +=
        ScanTimeS(model.costs, model.scan_step_m, scan.exact.first_frame, scan.exact.last_frame);
  }
  costed.scans = scans.size();
  costed.counts = CountSetups(model, scans);
  std::optional<Measurement> before;
  for (const int index : OrderScans(model, scans)) {
    const Measurement& scan = scans[static_cast<size_t>(index)];
    const ChangeTimes times = before ? TimesBetween(model, *before, scan) : TimesBeforeFirst(model);
    costed.turn_s += times.turn_s + times.reposition_s;
    costed.lay_s += times.lay_s;
    costed.move_sensors_s += times.move_sensors_s;
    before = scan;
  }
  return costed;
}

void Print(const char* what, const Costed& plan) {
  std::printf("  %-14s%6zu%8d%8d%7d%9.1f%8.1f%8.1f%8.1f%8.1f\n", what, plan.scans,
              plan.counts.setups, plan.counts.places, plan.counts.rests, plan.Total_s() / 60,
              plan.scan_s / 60, plan.turn_s / 60, plan.lay_s / 60, plan.move_sensors_s / 60);
}

Json ToJson(const Costed& plan) {
  return {{"scans", plan.scans},
          {"setups", plan.counts.setups},
          {"places", plan.counts.places},
          {"faces", plan.counts.rests},
          {"time_s", plan.Total_s()},
          {"scan_s", plan.scan_s},
          {"turn_s", plan.turn_s},
          {"lay_s", plan.lay_s},
          {"move_sensors_s", plan.move_sensors_s}};
}

Json RunInspection(const Options& options, const std::string& file) {
  SessionOptions session_options;
  session_options.inspection_file = file;
  session_options.fresh_targets = false;
  auto session = OpenSession(session_options);
  if (!session.ok()) Fail(file, std::string(session.status().message()));
  const Inspection& inspection = session->inspection;
  PlannerRequest request;
  request.domain = inspection.domain;
  request.goal = inspection.goal;
  request.execution = ExecutionModelOf(inspection);
  request.seed = options.seed;
  request.evaluations_per_scan = options.evaluations_per_scan;
  request.with_curves = false;
  const FrameEstimate frames(inspection.rig, session->client->scene().part_centre_m,
                             session->client->targets());
  request.scan_time_s = [&](const Measurement& scan) {
    const FrameRange range = frames.Frames(scan);
    return ScanTimeS(inspection.costs, inspection.rig.scan_step_m, range.first, range.last);
  };
  std::optional<PlannerResult> fewest;
  double fewest_s = 0, least_time_s = 0;
  bool least_time = false;
  BoundedPlanHooks hooks;
  hooks.on_begin = [&](PlanStep step) { least_time = step == PlanStep::kLeastTime; };
  hooks.on_end = [&](PlanStep step, double seconds) {
    (step == PlanStep::kLeastTime ? least_time_s : fewest_s) += seconds;
  };
  hooks.on_plan = [&](const PlannerResult& plan) {
    if (!least_time) fewest = plan;
    return absl::OkStatus();
  };
  const auto found =
      MakeBoundedPlan(*session->gain_model, request, options.bound_evaluations, hooks);
  if (!found.ok()) Fail(file, std::string(found.status().message()));
  const Costed before = CostOf(request.execution, *fewest);
  const Costed after = CostOf(request.execution, found->plan);
  const double saved = 1 - after.Total_s() / before.Total_s();
  std::printf("%s: %.1f %% less time; %.0f s of planning and %.0f s for fewer set-ups\n",
              inspection.name.c_str(), 100 * saved, fewest_s, least_time_s);
  Print("fewest scans", before);
  Print("least time", after);
  return {{"inspection", inspection.name},
          {"fewest_scans", ToJson(before)},
          {"least_time", ToJson(after)},
          {"time_saved", saved},
          {"bound_scans", found->bound ? found->bound->bound : 0},
          {"planning_s", fewest_s},
          {"least_time_planning_s", least_time_s}};
}

int Run(const Options& options) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  PrintMachine();
  std::printf("  %-14s%6s%8s%8s%7s%9s%8s%8s%8s%8s\n", "", "scans", "setups", "places", "faces",
              "minutes", "scan", "turn", "lay", "sensors");
  Json rows = Json::array();
  for (const std::string& file : options.inspections) rows.push_back(RunInspection(options, file));
  WriteResults(options.json, "least_time", rows);
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  sightline::bench::Options options;
  CLI::App app("plans of least time beside plans of fewest scans");
  app.add_option("inspections", options.inspections, "inspection.json files")->required();
  app.add_option("--seed", options.seed);
  app.add_option("--bound-evaluations", options.bound_evaluations)->check(CLI::NonNegativeNumber);
  app.add_option("--evaluations-per-scan", options.evaluations_per_scan)
      ->check(CLI::PositiveNumber);
  app.add_option("--json", options.json);
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(options);
}
