// SPDX-License-Identifier: Apache-2.0
// The fast estimate of the information of scans against exact inference on their points:
// admissible targets of single scans and of growing plans, as fractions of the toleranced targets.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <memory>
#include <vector>

#include "bench/common/measure.h"
#include "bench/common/parts.h"
#include "bench/common/scans.h"
#include "core/random/random.h"
#include "coverage_server/uncertainty/target_priors.h"
#include "planning/optimise/search_space.h"

namespace sightline::bench {
namespace {

struct Task {
  double admissible_m = 5e-5;
  double relaxed_m = 1e-3;
  GainWeights weights{.admissible = 0.5, .information = 0.5};
};

std::unique_ptr<CoverageScene> BuildUncertainScene(const TriangleMesh& mesh, double spacing_m,
                                                   double noise_px, double step_m) {
  SceneDefinition definition;
  definition.part = mesh;
  definition.sampling.spacing_m = spacing_m;
  definition.rig.scan_step_m = step_m;
  definition.uncertainty.emplace();
  definition.uncertainty->detection.standard_deviations_px = {noise_px};
  auto scene = CoverageScene::Build(std::move(definition), {});
  if (!scene.ok()) Fail("scene", std::string(scene.status().message()));
  return std::move(*scene);
}

// Hill climbs on the gain after what is known.
Measurement Climb(const CoverageScene& scene, const Task& task, const std::vector<float>& known,
                  int batches, uint64_t seed) {
  const SearchSpace space(ThesisDomain());
  Random random(seed);
  const std::vector<float> admissible = {static_cast<float>(task.admissible_m)};
  UncertaintyRequirement requirement{.weights = task.weights,
                                     .admissible_uncertainty_m = admissible,
                                     .relaxed_uncertainty_m = task.relaxed_m,
                                     .known_density = known,
                                     .covered = nullptr,
                                     .target_weights = {}};
  std::vector<double> best(space.dimension(), 0.5);
  double best_gain = -1;
  constexpr int kBatch = 64;
  for (int b = 0; b < batches || best_gain <= 0; ++b) {
    std::vector<std::vector<double>> points;
    std::vector<Measurement> scans;
    const double step = b < 4 ? 0 : 0.15 * std::exp(-3.0 * b / batches);
    for (int k = 0; k < kBatch; ++k) {
      std::vector<double> x(space.dimension());
      for (size_t i = 0; i < x.size(); ++i) {
        x[i] = step == 0 ? random.Uniform() : best[i] + step * random.Normal();
      }
      points.push_back(space.Normalise(x));
      scans.push_back(space.ToMeasurement(points.back()));
    }
    std::vector<UncertaintyGain> gains(scans.size());
    scene.EvaluateUncertaintyGains(scans, requirement, gains, nullptr);
    for (int k = 0; k < kBatch; ++k) {
      if (gains[k].feasibility != Feasibility::kFeasible || gains[k].gain <= best_gain) continue;
      best_gain = gains[k].gain;
      best = points[k];
    }
  }
  return space.ToMeasurement(best);
}

struct Counts {
  double fast = 0, exact = 0;  // admissible
  double fast_relaxed = 0, exact_relaxed = 0;
  double differ = 0;        // targets admissible in one answer only
  double median_ratio = 0;  // fast u over exact u where exact is at most 4 x admissible
  double seconds = 0;
};

Counts Compare(const CoverageScene& scene, const Task& task, const std::vector<Measurement>& plan,
               const std::vector<uint32_t>& targets) {
  std::vector<FastInformation> fast(plan.size());
  scene.EvaluateInformation(plan, fast, nullptr);
  std::vector<double> density(scene.targets().size(), 0);
  for (const FastInformation& scan : fast) {
    for (size_t i = 0; i < scan.information.targets.size(); ++i) {
      density[scan.information.targets[i]] += scan.information.density[i];
    }
  }
  std::vector<std::shared_ptr<const ScanPoints>> points(plan.size());
  const Stopwatch watch;
  ParallelFor(2, plan.size(),
              [&](size_t i) { points[i] = scene.MeasureForInference(plan[i], nullptr).points; });
  std::vector<TargetUncertainty> exact(targets.size());
  constexpr size_t kChunk = 64;
  ParallelFor(2, (targets.size() + kChunk - 1) / kChunk, [&](size_t chunk) {
    const size_t begin = chunk * kChunk, count = std::min(kChunk, targets.size() - begin);
    scene.Infer(points, std::span(targets).subspan(begin, count), false, {},
                std::span(exact).subspan(begin, count), nullptr);
  });
  Counts counts;
  counts.seconds = watch.Seconds();
  std::vector<double> ratios;
  const auto n = static_cast<double>(targets.size());
  for (size_t i = 0; i < targets.size(); ++i) {
    const SurfacePrior& prior = scene.priors()->of(targets[i]);
    const double d = density[targets[i]];
    const double fast_m = d > 0 ? UncertaintyAtDensity(prior, d) : prior.standard_deviation_m;
    const double exact_m = exact[i].uncertainty.total_m;
    const bool f = fast_m <= task.admissible_m, e = exact_m <= task.admissible_m;
    counts.fast += f / n;
    counts.exact += e / n;
    counts.differ += (f != e) / n;
    counts.fast_relaxed += (fast_m <= task.relaxed_m) / n;
    counts.exact_relaxed += (exact_m <= task.relaxed_m) / n;
    if (exact_m <= 4 * task.admissible_m) ratios.push_back(fast_m / exact_m);
  }
  counts.median_ratio = ratios.empty() ? 0 : Median(ratios);
  return counts;
}

int Run(const std::vector<std::string>& names, int single, int plan_scans, double noise_px,
        double step_m, int stride, const std::string& json) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  PrintMachine();
  Json results = Json::array();
  const Task task;
  for (const std::string& name : names) {
    const std::unique_ptr<TriangleMesh> mesh = LoadBenchPart(name);
    if (mesh == nullptr) continue;
    const auto scene = BuildUncertainScene(*mesh, 0.005, noise_px, step_m);
    std::vector<uint32_t> targets;
    for (size_t t = 0; t < scene->targets().size(); ++t) {
      if (scene->measurable().Test(t) && t % static_cast<size_t>(stride) == 0) {
        targets.push_back(static_cast<uint32_t>(t));
      }
    }
    std::printf("\n%s: %zu targets, %zu compared\n", name.c_str(), scene->targets().size(),
                targets.size());
    std::printf("%-16s %17s %8s %8s %17s %8s %8s\n", "scans", "admissible f/e %", "differ", "",
                "relaxed f/e %", "u ratio", "s exact");
    const auto print = [&](const char* label, const Counts& c) {
      std::printf("%-16s %7.2f / %7.2f %7.2f%% %8s %7.2f / %7.2f %8.3f %8.2f\n", label,
                  100 * c.fast, 100 * c.exact, 100 * c.differ, "", 100 * c.fast_relaxed,
                  100 * c.exact_relaxed, c.median_ratio, c.seconds);
    };
    std::vector<double> fast, exact, errors;
    const std::vector<float> nothing;
    for (int i = 0; i < single; ++i) {
      const Measurement scan =
          Climb(*scene, task, nothing, 2 + i % 20, DeriveSeed(7, static_cast<uint64_t>(i)));
      const Counts c = Compare(*scene, task, {scan}, targets);
      fast.push_back(c.fast);
      exact.push_back(c.exact);
      errors.push_back(std::abs(c.fast - c.exact));
      if (i < 8) print("one climbed", c);
    }
    if (single > 0) {
      std::printf("%d single scans: mean |e| %.3f %%, worst %.3f %%, Spearman %.5f\n", single,
                  100 * Mean(errors), 100 * Quantile(errors, 1), Spearman(fast, exact));
    }
    std::vector<float> known(scene->targets().size(), 0);
    std::vector<Measurement> plan;
    Json rows = Json::array();
    for (int i = 0; i < plan_scans; ++i) {
      plan.push_back(Climb(*scene, task, known, 40, DeriveSeed(3, static_cast<uint64_t>(i))));
      std::vector<FastInformation> info(1);
      scene->EvaluateInformation({&plan.back(), 1}, info, nullptr);
      for (size_t k = 0; k < info[0].information.targets.size(); ++k) {
        known[info[0].information.targets[k]] += info[0].information.density[k];
      }
      if ((i + 1) % 3 != 0 && i + 1 != plan_scans) continue;
      const Counts c = Compare(*scene, task, plan, targets);
      print((std::to_string(i + 1) + " of a plan").c_str(), c);
      rows.push_back({{"scans", i + 1},
                      {"fast", c.fast},
                      {"exact", c.exact},
                      {"differ", c.differ},
                      {"seconds", c.seconds}});
    }
    results.push_back({{"part", name},
                       {"single_mean_error", errors.empty() ? 0 : Mean(errors)},
                       {"single_spearman", errors.empty() ? 0 : Spearman(fast, exact)},
                       {"plan", rows}});
  }
  std::printf("\nf: fast, e: exact; admissible: u <= %.3f mm, relaxed: u <= %.1f mm\n",
              1e3 * task.admissible_m, 1e3 * task.relaxed_m);
  WriteResults(json, "uncertainty_fast_vs_exact", results);
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("The fast estimate of uncertainty gains against exact inference");
  std::vector<std::string> parts = {"head"};
  int single = 60, plan_scans = 12, stride = 4;
  double noise_px = 0.2, step_m = 0.0005;
  std::string json;
  app.add_option("--parts", parts)->delimiter(',');
  app.add_option("--single", single, "scans climbed from nothing");
  app.add_option("--plan", plan_scans, "scans of a greedy plan");
  app.add_option("--stride", stride, "every so many targets are compared");
  app.add_option("--noise-px", noise_px);
  app.add_option("--step-m", step_m, "stage travel between frames");
  app.add_option("--json", json);
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(parts, single, plan_scans, noise_px, step_m, stride, json);
}
