// SPDX-License-Identifier: Apache-2.0
// Coverage under errors of placement as plans state it, against simulated executions.
//
// The statement is a 5 % quantile that combines few evaluations (planning/placement). Here
// all scans of every execution are evaluated at displacements of their own, from another seed.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "bench/common/measure.h"
#include "bench/common/parts.h"
#include "bench/common/scene_gain_model.h"
#include "core/physics/angle.h"
#include "core/statistics/order_statistics.h"
#include "planning/placement/placement_coverage.h"
#include "planning/strategy/planner.h"
#include "planning/strategy/scan_order.h"

namespace sightline::bench {
namespace {

struct Options {
  int executions = 200;
  double goal = 0.95;
  double targets = 8000;
  int64_t seed = 1;
  std::string json;
};

// A rigid head with two places and the thesis's free rig.
MeasurementDomain DomainOf(bool rigid) {
  MeasurementDomain domain = ThesisDomain();
  if (!rigid) return domain;
  const auto values = [&](MeasurementParameter parameter, std::vector<double> allowed) {
    domain.parameters[parameter].ranges.clear();
    domain.parameters[parameter].values = std::move(allowed);
  };
  values(kCameraDistance, {0.3});
  values(kTriangulationAngle, {30 * kRadPerDeg});
  values(kCameraAzimuth, {0});
  values(kCameraPolar, {0, 30 * kRadPerDeg});
  return domain;
}

Json RunPart(const Options& options, const std::string& name, const TriangleMesh& mesh,
             bool rigid) {
  SceneDefinition definition;
  definition.part = mesh;
  definition.sampling.spacing_m = SpacingForTargets(mesh, options.targets);
  definition.domain = DomainOf(rigid);
  const MeasurementDomain domain = *definition.domain;
  auto built = CoverageScene::Build(std::move(definition), {});
  if (!built.ok()) Fail(name, std::string(built.status().message()));
  const CoverageScene& scene = **built;
  SceneGainModel gain_model(scene);
  PlannerRequest request;
  request.domain = domain;
  request.goal.coverage = options.goal;
  request.seed = options.seed;
  auto plan = MakePlan(gain_model, request);
  if (!plan.ok()) Fail(name, std::string(plan.status().message()));

  PlacementModel model;
  model.errors = {2e-3, kRadPerDeg, 2e-3, kRadPerDeg};
  model.rig = scene.rig();
  model.rigid_head = rigid;
  model.execution.costs.turn_time_s = 60;
  model.execution.costs.move_sensors_time_s = 900;
  std::vector<Measurement> chosen, scans;
  for (const ChosenScan& scan : plan->scans) chosen.push_back(scan.measurement);
  for (const int index : OrderScans(model.execution, chosen)) {
    scans.push_back(chosen[static_cast<size_t>(index)]);
  }
  const int64_t measurable = scene.measurable().Count();
  const auto evaluate = [&](std::span<const Measurement> measurements,
                            std::span<const ScanDisplacement> displacements)
      -> absl::StatusOr<std::vector<ScanCoverage>> {
    std::vector<ScanCoverage> coverages(measurements.size());
    ParallelFor(2, measurements.size(), [&](size_t i) {
      ExactCoverage exact = scene.EvaluateDisplaced(measurements[i], displacements[i], nullptr);
      coverages[i].covered = std::move(exact.covered);
      coverages[i].covered &= scene.measurable();
    });
    return coverages;
  };
  const auto stated = PlacementCoverage(model, scans, measurable, evaluate);
  if (!stated.ok()) Fail(name, std::string(stated.status().message()));

  const PlacementDraws draws(model, scans);
  constexpr uint64_t kOtherSeed = 2026;
  std::vector<double> simulated;
  for (int e = 0; e < options.executions; ++e) {
    const auto coverages = evaluate(scans, draws.Draw(kOtherSeed, static_cast<uint32_t>(e)));
    TargetBits together(scene.targets().size());
    for (const ScanCoverage& scan : *coverages) together |= scan.covered;
    simulated.push_back(static_cast<double>(together.Count()) / static_cast<double>(measurable));
  }
  const double p5 = LowerQuantile(simulated, 0.05), median = LowerQuantile(simulated, 0.5);
  const std::vector<ScanDisplacement> exact_places(scans.size());
  TargetBits in_place(scene.targets().size());
  const auto undisturbed = evaluate(scans, exact_places);
  for (const ScanCoverage& scan : *undisturbed) in_place |= scan.covered;
  const double nominal = static_cast<double>(in_place.Count()) / static_cast<double>(measurable);
  std::printf("%12s%7s%9ld%7zu%8zu%9.2f%9.2f%9.2f%9.2f%9.2f\n", name.c_str(),
              rigid ? "rigid" : "free", static_cast<long>(measurable), scans.size(),
              draws.group_ends().size(), 100 * nominal, 100 * median, 100 * p5, 100 * *stated,
              100 * (*stated - p5));
  return {{"part", name},
          {"rig", rigid ? "rigid" : "free"},
          {"targets", measurable},
          {"scans", scans.size()},
          {"groups", draws.group_ends().size()},
          {"coverage_in_place", nominal},
          {"simulated_median", median},
          {"simulated_p5", p5},
          {"stated_p5", *stated}};
}

int Run(const Options& options) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  PrintMachine();
  std::printf("5 %% quantiles of %d executions and as stated, %% of the measurable targets\n",
              options.executions);
  std::printf("%12s%7s%9s%7s%8s%9s%9s%9s%9s%9s\n", "part", "rig", "targets", "scans", "groups",
              "in place", "median", "5 %", "stated", "error");
  Json rows = Json::array();
  for (const char* name : {"head", "bracket-262"}) {
    const auto mesh = LoadBenchPart(name);
    if (mesh == nullptr) continue;
    for (const bool rigid : {false, true}) rows.push_back(RunPart(options, name, *mesh, rigid));
  }
  WriteResults(options.json, "placement", rows);
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  sightline::bench::Options options;
  CLI::App app("coverage under errors of placement, stated and simulated");
  app.add_option("--executions", options.executions)->check(CLI::Range(20, 100000));
  app.add_option("--goal", options.goal)->check(CLI::Range(0.01, 1.0));
  app.add_option("--targets", options.targets)->check(CLI::Range(100, 1000000));
  app.add_option("--seed", options.seed);
  app.add_option("--json", options.json);
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(options);
}
