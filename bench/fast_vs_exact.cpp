// SPDX-License-Identifier: Apache-2.0
// Error of the fast evaluator against the exact one, in fractions of all targets.
#include <CLI/CLI.hpp>
#include <cstdio>

#include "bench/common/measure.h"
#include "bench/common/parts.h"
#include "bench/common/scans.h"

namespace sightline::bench {
namespace {

struct Comparison {
  Json json;
  Measurement worst;
  double worst_error = 0;
};

// Coverage of measurable targets by scans that both evaluators call feasible.
Comparison Compare(const CoverageScene& scene, const std::vector<Measurement>& scans) {
  std::vector<FastCoverage> fast(scans.size());
  scene.EvaluateFastCoverage(scans, fast, nullptr);
  std::vector<ExactCoverage> exact(scans.size());
  ParallelFor(2, scans.size(),
              [&](size_t i) { exact[i] = scene.EvaluateExact(scans[i], nullptr, nullptr); });
  const auto targets = static_cast<double>(scene.targets().size());
  Comparison result;
  std::vector<double> fast_fractions, exact_fractions, signed_errors, absolute_errors, bit_errors;
  std::vector<double> unmeasurable;
  int infeasible = 0;
  for (size_t i = 0; i < scans.size(); ++i) {
    if (exact[i].feasibility != fast[i].feasibility) ++infeasible;
    if (exact[i].feasibility != Feasibility::kFeasible ||
        fast[i].feasibility != Feasibility::kFeasible) {
      continue;
    }
    unmeasurable.push_back(static_cast<double>(exact[i].covered.CountNotIn(scene.measurable())) /
                           targets);
    TargetBits f = fast[i].covered, e = exact[i].covered;
    f &= scene.measurable();
    e &= scene.measurable();
    fast_fractions.push_back(static_cast<double>(f.Count()) / targets);
    exact_fractions.push_back(static_cast<double>(e.Count()) / targets);
    const double error = fast_fractions.back() - exact_fractions.back();
    signed_errors.push_back(error);
    absolute_errors.push_back(std::abs(error));
    bit_errors.push_back(static_cast<double>(f.CountNotIn(e) + e.CountNotIn(f)) / targets);
    if (std::abs(error) > std::abs(result.worst_error)) {
      result.worst_error = error;
      result.worst = scans[i];
    }
  }
  const auto [low, high] = std::minmax_element(exact_fractions.begin(), exact_fractions.end());
  result.json = {{"scans", absolute_errors.size()},
                 {"feasibility_differs", infeasible},
                 {"mean_exact_coverage", Mean(exact_fractions)},
                 {"min_exact_coverage", *low},
                 {"max_exact_coverage", *high},
                 {"mean_absolute_error", Mean(absolute_errors)},
                 {"mean_signed_error", Mean(signed_errors)},
                 {"p95_absolute_error", Quantile(absolute_errors, 0.95)},
                 {"worst_error", result.worst_error},
                 {"worst_scan", Describe(result.worst)},
                 {"spearman", Spearman(fast_fractions, exact_fractions)},
                 {"targets_that_differ", Mean(bit_errors)},
                 {"mean_exact_coverage_not_measurable", Mean(unmeasurable)}};
  return result;
}

int Run(std::vector<std::string> names, int random_count, int climbed_count, double spacing_m,
        const std::string& json) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  PrintMachine();
  if (names.empty()) names = PartNames();
  Json results = Json::array();
  for (const std::string& name : names) {
    const std::unique_ptr<TriangleMesh> mesh = LoadBenchPart(name);
    if (mesh == nullptr) continue;
    const std::unique_ptr<CoverageScene> scene = BuildScene(*mesh, spacing_m);
    std::printf("\n%s: %zu triangles, %zu targets (%.1f %% measurable)\n", name.c_str(),
                mesh->triangles.size(), scene->targets().size(),
                100.0 * static_cast<double>(scene->measurable().Count()) /
                    static_cast<double>(scene->targets().size()));
    std::vector<Measurement> good = ClimbedScans(*scene, climbed_count, 30, 11);
    std::vector<Measurement> planned;
    for (const int seed : {1, 2}) {
      const auto scans = GreedyPlanScans(*scene, 0.95, 2000, seed);
      planned.insert(planned.end(), scans.begin(), scans.end());
    }
    std::vector<Measurement> all_good = good;
    all_good.insert(all_good.end(), planned.begin(), planned.end());
    const std::vector<std::pair<std::string, std::vector<Measurement>>> sets = {
        {"random", RandomScans(*scene, random_count, 10)},
        {"hill climbed", good},
        {"greedy plans", planned},
        {"good: both", all_good}};
    std::printf("%-14s %6s %18s %9s %9s %9s %9s %9s %9s %7s\n", "scans", "number",
                "exact min-max %", "mean |e|", "mean e", "p95 |e|", "worst e", "Spearman", "bits",
                "infeas.");
    Json part{{"part", name},
              {"triangles", mesh->triangles.size()},
              {"targets", scene->targets().size()},
              {"measurable", scene->measurable().Count()},
              {"sets", Json::array()}};
    Comparison worst;
    for (const auto& [label, scans] : sets) {
      Comparison c = Compare(*scene, scans);
      const auto value = [&](const char* key) { return c.json[key].get<double>(); };
      std::printf("%-14s %6d %8.2f - %7.2f %8.3f%% %+8.3f%% %8.3f%% %+8.3f%% %9.5f %8.3f%% %7d\n",
                  label.c_str(), c.json["scans"].get<int>(), 100 * value("min_exact_coverage"),
                  100 * value("max_exact_coverage"), 100 * value("mean_absolute_error"),
                  100 * value("mean_signed_error"), 100 * value("p95_absolute_error"),
                  100 * value("worst_error"), value("spearman"), 100 * value("targets_that_differ"),
                  c.json["feasibility_differs"].get<int>());
      c.json["set"] = label;
      part["sets"].push_back(c.json);
      if (std::abs(c.worst_error) > std::abs(worst.worst_error)) worst = c;
    }
    std::printf("worst: %+.3f %% of targets: %s\n", 100 * worst.worst_error,
                Describe(worst.worst).c_str());
    results.push_back(part);
  }
  std::printf(
      "\ne: covered measurable targets, fast - exact, in %% of all targets. bits: targets "
      "in one answer only. infeas.: feasible for one evaluator only.\n");
  WriteResults(json, "fast_vs_exact", results);
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("Error of the fast evaluator against the exact one");
  std::vector<std::string> parts;
  int random_count = 300, climbed_count = 150;
  double spacing_m = 0.005;
  std::string json;
  app.add_option("--parts", parts, "default: all")->delimiter(',');
  app.add_option("--random", random_count);
  app.add_option("--climbed", climbed_count);
  app.add_option("--spacing-m", spacing_m);
  app.add_option("--json", json);
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(parts, random_count, climbed_count, spacing_m, json);
}
