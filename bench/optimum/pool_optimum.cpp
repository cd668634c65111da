// SPDX-License-Identifier: Apache-2.0
// Number of scans of plans against the optimum over a pool of scans, for parts small enough that
// the optimum can be found: partial set cover, solved by trying all pairs and else by branch and
// cut (CBC).
//
// The pool has random scans of the domain, the scans of the plan, and the columns that its lower
// bound generated. The optimum over the pool is no more than that of the plan; a scan outside the
// pool could still lower it.
#include <CLI/CLI.hpp>
#include <CbcModel.hpp>
#include <OsiClpSolverInterface.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "bench/common/measure.h"
#include "bench/common/scene_gain_model.h"
#include "core/physics/angle.h"
#include "core/random/random.h"
#include "coverage_server/scene/coverage_scene.h"
#include "planning/optimise/search_space.h"
#include "planning/strategy/cover_bits.h"
#include "planning/strategy/generated_columns_plan.h"
#include "planning/strategy/planner.h"
#include "planning/strategy/scan_count_bound.h"

namespace sightline::bench {
namespace {

struct Options {
  double goal = 0.95;
  int pool = 10000;
  int64_t bound_evaluations = 100000;
  double spacing_m = 0.004;
  int64_t seed = 1;
  std::string json;
};

void AddBox(const Eigen::Vector3f& low, const Eigen::Vector3f& high, TriangleMesh* mesh) {
  const auto first = static_cast<uint32_t>(mesh->positions_m.size());
  for (int corner = 0; corner < 8; ++corner) {
    mesh->positions_m.push_back({(corner & 1 ? high : low).x(), (corner & 2 ? high : low).y(),
                                 (corner & 4 ? high : low).z()});
  }
  const uint32_t faces[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                 {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  for (const auto& face : faces) {
    mesh->triangles.push_back({first + face[0], first + face[1], first + face[2]});
  }
}

// A block, and one with two steps: its outline extruded, without inner walls.
TriangleMesh Box() {
  TriangleMesh mesh;
  AddBox({0, 0, 0}, {0.08f, 0.06f, 0.05f}, &mesh);
  return mesh;
}

TriangleMesh SteppedBlock() {
  constexpr float kDepth_m = 0.06f;
  // x and z of the outline, counterclockwise seen from -y.
  const std::vector<std::pair<float, float>> outline = {
      {0, 0},         {0.09f, 0},     {0.09f, 0.02f}, {0.06f, 0.02f},
      {0.06f, 0.04f}, {0.03f, 0.04f}, {0.03f, 0.06f}, {0, 0.06f}};
  TriangleMesh mesh;
  for (const float y : {0.0f, kDepth_m}) {
    for (const auto& [x, z] : outline) mesh.positions_m.push_back({x, y, z});
  }
  const auto n = static_cast<uint32_t>(outline.size());
  for (uint32_t i = 0; i < n; ++i) {
    const uint32_t j = (i + 1) % n;
    mesh.triangles.push_back({i, n + j, j});
    mesh.triangles.push_back({i, n + i, n + j});
  }
  // Three rectangles of the outline, one on the other, at either end.
  const uint32_t quads[3][4] = {{0, 1, 2, 3}, {0, 3, 4, 5}, {0, 5, 6, 7}};
  for (const auto& q : quads) {
    for (const auto& [a, b, c] : {std::array{q[0], q[2], q[1]}, std::array{q[0], q[3], q[2]}}) {
      mesh.triangles.push_back({a, c, b});
      mesh.triangles.push_back({n + a, n + b, n + c});
    }
  }
  return mesh;
}

// 1 or 2 if so many columns cover at least `goal_targets`, by trying all; else 0.
int OneOrTwo(const std::vector<TargetBits>& columns, int64_t goal_targets) {
  for (size_t a = 0; a < columns.size(); ++a) {
    if (columns[a].Count() >= goal_targets) return 1;
  }
  for (size_t a = 0; a < columns.size(); ++a) {
    for (size_t b = 0; b < a; ++b) {
      if (columns[a].Count() + CountOnlyIn(columns[b], columns[a]) >= goal_targets) return 2;
    }
  }
  return 0;
}

// Fewest columns that cover at least `goal_targets`; -1: not solved within the time limit.
int OptimumOver(const std::vector<TargetBits>& columns, int64_t goal_targets) {
  if (const int few = OneOrTwo(columns, goal_targets); few > 0) return few;
  // Targets that the same columns cover are one row with their number as weight.
  std::map<std::vector<int>, double> rows;
  const size_t targets = columns.empty() ? 0 : columns.front().size();
  for (size_t t = 0; t < targets; ++t) {
    std::vector<int> by;
    for (size_t c = 0; c < columns.size(); ++c) {
      if (columns[c].Test(t)) by.push_back(static_cast<int>(c));
    }
    if (!by.empty()) rows[by] += 1;
  }
  // Variables: chosen columns, then covered rows, which need not be integer.
  const int n = static_cast<int>(columns.size());
  OsiClpSolverInterface solver;
  solver.setLogLevel(0);
  for (int c = 0; c < n; ++c) {
    solver.addCol(0, nullptr, nullptr, 0, 1, 1);
    solver.setInteger(c);
  }
  for (size_t r = 0; r < rows.size(); ++r) solver.addCol(0, nullptr, nullptr, 0, 1, 0);
  std::vector<int> covered;
  std::vector<double> weights;
  for (const auto& [by, weight] : rows) {
    const int row = n + static_cast<int>(covered.size());
    std::vector<int> indices = by;
    std::vector<double> elements(by.size(), 1);
    indices.push_back(row);
    elements.push_back(-1);
    solver.addRow(static_cast<int>(indices.size()), indices.data(), elements.data(), 0,
                  COIN_DBL_MAX);
    covered.push_back(row);
    weights.push_back(weight);
  }
  solver.addRow(static_cast<int>(covered.size()), covered.data(), weights.data(),
                static_cast<double>(goal_targets), COIN_DBL_MAX);
  CbcModel model(solver);
  model.setLogLevel(0);
  model.setMaximumSeconds(600);
  model.branchAndBound();
  return model.isProvenOptimal() ? static_cast<int>(std::lround(model.getObjValue())) : -1;
}

// Columns that no other column contains: the others are in no better plan.
std::vector<TargetBits> Undominated(std::vector<TargetBits> columns) {
  std::sort(columns.begin(), columns.end(),
            [](const TargetBits& a, const TargetBits& b) { return a.Count() > b.Count(); });
  std::vector<TargetBits> kept;
  for (TargetBits& column : columns) {
    const bool inside = std::any_of(kept.begin(), kept.end(), [&](const TargetBits& other) {
      return CountOnlyIn(column, other) == 0;
    });
    if (!inside) kept.push_back(std::move(column));
  }
  return kept;
}

Json RunPart(const Options& options, const std::string& name, TriangleMesh mesh, bool resting) {
  SceneDefinition definition;
  definition.part = std::move(mesh);
  definition.sampling.spacing_m = options.spacing_m;
  definition.domain = ThesisDomain();
  if (resting) {
    // The two large faces, with a table.
    definition.domain->resting_orientations = {{0, 0}, {std::numbers::pi, 0}};
    TriangleMesh table;
    AddBox({-0.3f, -0.3f, -0.02f}, {0.3f, 0.3f, 0}, &table);
    definition.obstacles.push_back({std::move(table), ObstacleFrame::kTable});
  }
  const MeasurementDomain domain = *definition.domain;
  auto scene = CoverageScene::Build(std::move(definition), {});
  if (!scene.ok()) Fail(name, std::string(scene.status().message()));
  SceneGainModel gain_model(**scene);
  PlannerRequest request;
  request.domain = domain;
  request.goal.coverage = options.goal;
  request.seed = options.seed;
  auto plan = MakePlan(gain_model, request);
  if (!plan.ok()) Fail(name, std::string(plan.status().message()));
  std::vector<Measurement> scans;
  for (const ChosenScan& scan : plan->scans) scans.push_back(scan.measurement);
  const auto bound = BoundScanCount(gain_model, domain, options.goal, scans,
                                    options.bound_evaluations, options.seed);
  if (!bound.ok()) Fail(name, std::string(bound.status().message()));
  plan = PlanWithGeneratedColumns(gain_model, request, *std::move(plan), *bound);
  if (!plan.ok()) Fail(name, std::string(plan.status().message()));

  for (const ChosenScan& scan : plan->scans) scans.push_back(scan.measurement);
  scans.insert(scans.end(), bound->generated_columns.begin(), bound->generated_columns.end());
  const SearchSpace space(domain);
  Random random(static_cast<uint64_t>(options.seed));
  while (static_cast<int>(scans.size()) < options.pool) {
    std::vector<double> x(space.dimension());
    for (double& coordinate : x) coordinate = random.Uniform();
    scans.push_back(space.ToMeasurement(x));
  }
  auto coverage = gain_model.FastCoverage(scans);
  if (!coverage.ok()) Fail(name, std::string(coverage.status().message()));
  std::vector<TargetBits> columns;
  for (ScanCoverage& scan : *coverage) {
    if (scan.feasibility == ScanFeasibility::kFeasible) columns.push_back(std::move(scan.covered));
  }
  columns = Undominated(std::move(columns));
  const int optimum = OptimumOver(columns, bound->goal_targets);
  std::printf("%16s%9ld%7d%9zu%9d%8.2f%11s%7zu\n", name.c_str(),
              static_cast<long>(gain_model.measurable().Count()), options.pool, columns.size(),
              optimum, bound->bound, bound->converged ? "yes" : "no", plan->scans.size());
  return {{"part", name},
          {"targets", gain_model.measurable().Count()},
          {"pool", options.pool},
          {"undominated", columns.size()},
          {"optimum_over_pool", optimum},
          {"bound", bound->bound},
          {"converged", bound->converged},
          {"plan", plan->scans.size()}};
}

int Run(const Options& options) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  PrintMachine();
  std::printf("%16s%9s%7s%9s%9s%8s%11s%7s\n", "part", "targets", "pool", "columns", "optimum",
              "bound", "converged", "plan");
  Json rows = Json::array();
  rows.push_back(RunPart(options, "box, free", Box(), false));
  rows.push_back(RunPart(options, "box, table", Box(), true));
  rows.push_back(RunPart(options, "steps, free", SteppedBlock(), false));
  rows.push_back(RunPart(options, "steps, table", SteppedBlock(), true));
  WriteResults(options.json, "pool_optimum", rows);
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  sightline::bench::Options options;
  CLI::App app("scans of plans against the optimum over a pool of scans");
  app.add_option("--goal", options.goal)->check(CLI::Range(0.01, 1.0));
  app.add_option("--pool", options.pool, "scans in the pool")->check(CLI::Range(10, 1000000));
  app.add_option("--bound-evaluations", options.bound_evaluations)->check(CLI::PositiveNumber);
  app.add_option("--spacing", options.spacing_m, "between targets, m")->check(CLI::PositiveNumber);
  app.add_option("--seed", options.seed);
  app.add_option("--json", options.json);
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(options);
}
