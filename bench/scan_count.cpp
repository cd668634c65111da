// SPDX-License-Identifier: Apache-2.0
// Number of scans of plans, before and after planning again with the columns that the lower bound
// generated, against that bound, part by part. Exact numbers on the plan's own targets.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "bench/common/measure.h"
#include "bench/common/parts.h"
#include "bench/common/scene_gain_model.h"
#include "planning/strategy/generated_columns_plan.h"
#include "planning/strategy/planner.h"
#include "planning/strategy/scan_count_bound.h"

namespace sightline::bench {
namespace {

struct Options {
  std::vector<std::string> parts;
  double goal = 0.95;
  double spacing_m = 0.005;
  int64_t bound_evaluations = 300000;
  int64_t seed = 1;
  std::string json;
};

Json RunPart(const Options& options, const std::string& name, const TriangleMesh& mesh) {
  const std::unique_ptr<CoverageScene> scene = BuildScene(mesh, options.spacing_m);
  SceneGainModel gain_model(*scene);
  const auto measurable = static_cast<double>(gain_model.measurable().Count());
  PlannerRequest request;
  request.domain = ThesisDomain();
  request.goal.coverage = options.goal;
  request.seed = options.seed;
  Stopwatch watch;
  auto plan = MakePlan(gain_model, request);
  if (!plan.ok()) Fail(name, std::string(plan.status().message()));
  const double plan_s = watch.Seconds();
  const size_t before = plan->scans.size();
  std::vector<Measurement> scans;
  for (const ChosenScan& scan : plan->scans) scans.push_back(scan.measurement);

  watch = {};
  const auto bound = BoundScanCount(gain_model, request.domain, options.goal, scans,
                                    options.bound_evaluations, options.seed);
  if (!bound.ok()) Fail(name, std::string(bound.status().message()));
  const double bound_s = watch.Seconds();

  watch = {};
  plan = PlanWithGeneratedColumns(gain_model, request, *std::move(plan), *bound);
  if (!plan.ok()) Fail(name, std::string(plan.status().message()));
  const double again_s = watch.Seconds();
  const double satisfied = static_cast<double>(plan->score.Claimed()) / measurable;
  std::printf("%14s%9.0f%7zu%8.1f%8.2f%11s%9zu%8.1f%7zu%8.1f%9.2f%%\n", name.c_str(), measurable,
              before, plan_s, bound->bound, bound->converged ? "yes" : "no",
              bound->generated_columns.size(), bound_s, plan->scans.size(), again_s,
              100 * satisfied);
  return {{"part", name},          {"targets", measurable},
          {"scans", before},       {"plan_s", plan_s},
          {"bound", bound->bound}, {"converged", bound->converged},
          {"bound_s", bound_s},    {"scans_with_priced", plan->scans.size()},
          {"again_s", again_s},    {"settled", satisfied}};
}

int Run(const Options& options) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  PrintMachine();
  std::printf("%14s%9s%7s%8s%8s%11s%9s%8s%7s%8s%10s\n", "part", "targets", "scans", "s", "bound",
              "converged", "priced", "s", "scans", "s", "settled");
  Json rows = Json::array();
  for (const std::string& name : options.parts.empty() ? PartNames() : options.parts) {
    const std::unique_ptr<TriangleMesh> mesh = LoadBenchPart(name);
    if (mesh != nullptr) rows.push_back(RunPart(options, name, *mesh));
  }
  WriteResults(options.json, "scan_count", rows);
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("Number of scans against the lower bound");
  sightline::bench::Options options;
  app.add_option("--parts", options.parts)->delimiter(',');
  app.add_option("--goal", options.goal)->check(CLI::Range(0.01, 1.0));
  app.add_option("--spacing-m", options.spacing_m)->check(CLI::PositiveNumber);
  app.add_option("--bound-evaluations", options.bound_evaluations)->check(CLI::Range(1, 100000000));
  app.add_option("--seed", options.seed);
  app.add_option("--json", options.json);
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(options);
}
