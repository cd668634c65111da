// SPDX-License-Identifier: Apache-2.0
// Gain queries by uncertainty beside those by coverage, of the same scans on the same part: in
// process and through gRPC. And what exact inference costs by the number of scans and targets.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>

#include "bench/common/measure.h"
#include "bench/common/parts.h"
#include "bench/common/scans.h"
#include "bench/common/server_process.h"
#include "planner_client/coverage_client/coverage_client.h"
#include "planner_client/gain_model/uncertainty_gain_model.h"
#include "planning/strategy/planner.h"

namespace sightline::bench {
namespace {

constexpr size_t kBatch = 64;

struct Rate {
  double per_s = 0;
  double cpu_us = 0;  // per query, client and server together
};

template <typename Work>
Rate Measure(double seconds, pid_t server, const std::vector<Measurement>& scans,
             const Work& work) {
  const double cpu = OwnCpuSeconds() + (server > 0 ? ProcessCpuSeconds(server) : 0);
  const Stopwatch watch;
  double count = 0;
  while (watch.Seconds() < seconds) {
    work(scans);
    count += static_cast<double>(scans.size());
  }
  const double spent = OwnCpuSeconds() + (server > 0 ? ProcessCpuSeconds(server) : 0) - cpu;
  return {count / watch.Seconds(), 1e6 * spent / count};
}

// A greedy plan after which 40 % of the targets are known to 0.05 mm.
std::vector<Measurement> PlanForUncertainty(CoverageClient& client, const CoverageTask& task) {
  const size_t count = client.targets().size();
  UncertaintyGainModel gain_model(
      {&client, FindTolerancedTargets(client, *task.uncertainty, task.sampling,
                                      std::vector<float>(count, 5e-5f), 1e-3)},
      {nullptr, {}}, *task.uncertainty, {.admissible = 0.5, .information = 0.5}, 1e-3);
  PlannerRequest request;
  request.domain = ThesisDomain();
  request.goal.coverage = 0;
  request.goal.admissible = 0.4;
  request.strategy = "greedy-pso-1";
  request.evaluations_per_scan = 2000;
  request.with_curves = false;
  auto result = MakePlan(gain_model, request);
  if (!result.ok()) Fail("plan", std::string(result.status().message()));
  std::vector<Measurement> scans;
  for (const ChosenScan& scan : result->scans) scans.push_back(scan.measurement);
  return scans;
}

int Run(double seconds, int rounds, const std::vector<int>& target_counts,
        const std::string& json) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  PrintMachine();
  const std::unique_ptr<TriangleMesh> mesh = LoadBenchPart("head");
  const std::string folder =
      std::filesystem::temp_directory_path() / ("sightline-bench-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  Json results = Json::array();
  for (const int targets : target_counts) {
    CoverageTask task;
    task.part = std::make_shared<const TriangleMesh>(*mesh);
    task.sampling.spacing_m = SpacingForTargets(*mesh, targets);
    task.rig.scan_step_m = 0.0005;
    task.uncertainty.emplace();
    const ServerProcess server("unix:" + folder + "/coverage.sock");
    CoverageClientOptions options;
    options.address = server.address();
    options.min_batch = options.max_batch = kBatch;
    auto client = CoverageClient::Open(options, task);
    if (!client.ok()) Fail("gRPC", std::string(client.status().message()));
    SceneDefinition definition;
    definition.part = *mesh;
    definition.rig = task.rig;
    definition.sampling = task.sampling;
    definition.uncertainty = task.uncertainty;
    auto scene = CoverageScene::Build(std::move(definition), {});
    if (!scene.ok()) Fail("scene", std::string(scene.status().message()));
    const size_t count = (*scene)->targets().size();
    std::printf("\ncylinder head, %zu targets\n", count);

    const std::vector<Measurement> plan = GreedyPlanScans(**scene, 0.8, 2000, 1);
    const std::vector<std::pair<std::string, std::vector<Measurement>>> mixes = {
        {"random feasible", RandomScans(**scene, 2048, 1)},
        {"good for coverage", Perturbed(**scene, plan, 2048, 0.01, 2)},
        {"good for uncertainty",
         Perturbed(**scene, PlanForUncertainty(**client, task), 2048, 0.01, 3)}};
    const UncertaintyQuery query{
        {.admissible = 0.5, .information = 0.5}, std::vector<float>(count, 5e-5f), 1e-3, {}};
    // As in the middle of planning: half of the targets are known to their admissible uncertainty.
    std::vector<float> known(count, 0);
    std::vector<float> shares(count, 0);
    const SurfacePrior prior{0.01, CovarianceLengthScale(0.003)};
    for (size_t t = 0; t < count; t += 2) {
      known[t] = static_cast<float>(DensityForUncertainty(prior, 5e-5));
      shares[t] = 1;
    }
    UncertaintyRequirement requirement{.weights = query.weights,
                                       .admissible_uncertainty_m = query.admissible_uncertainty_m,
                                       .relaxed_uncertainty_m = query.relaxed_uncertainty_m,
                                       .known_density = known,
                                       .covered = nullptr,
                                       .target_weights = {}};
    for (const auto& [mix, scans] : mixes) {
      struct Peer {
        const char* name;
        pid_t server;
        std::function<void(const std::vector<Measurement>&)> work;
        std::vector<double> per_s = {}, cpu_us = {};
      };
      const auto check = [](const auto& gains) {
        if (!gains.ok()) Fail("gRPC", std::string(gains.status().message()));
      };
      std::vector<Peer> peers = {
          {"coverage, gRPC", server.pid(),
           [&](const auto& s) { check((*client)->Gains(s, shares)); }},
          {"uncertainty, gRPC", server.pid(),
           [&](const auto& s) { check((*client)->UncertaintyGains(s, query, known, {})); }},
          {"uncertainty, in process", 0, [&](const auto& s) {
             ParallelFor(2, s.size() / kBatch, [&](size_t b) {
               std::vector<UncertaintyGain> gains(kBatch);
               (*scene)->EvaluateUncertaintyGains(std::span(s).subspan(b * kBatch, kBatch),
                                                  requirement, gains, nullptr);
             });
           }}};
      for (int round = 0; round < rounds; ++round) {
        for (Peer& peer : peers) {
          const Rate rate = Measure(seconds, peer.server, scans, peer.work);
          peer.per_s.push_back(rate.per_s);
          peer.cpu_us.push_back(rate.cpu_us);
        }
      }
      std::printf("%-21s %-26s %10s %8s %10s\n", mix.c_str(), "", "queries/s", "ratio", "CPU us");
      for (const Peer& peer : peers) {
        const double ratio = Median(peer.per_s) / Median(peers[0].per_s);
        std::printf("%-21s %-26s %10.0f %7.2fx %10.0f\n", "", peer.name, Median(peer.per_s), ratio,
                    Median(peer.cpu_us));
        results.push_back({{"targets", count},
                           {"mix", mix},
                           {"peer", peer.name},
                           {"queries_per_s", Median(peer.per_s)},
                           {"ratio_to_coverage", ratio},
                           {"cpu_us", Median(peer.cpu_us)}});
      }
    }

    std::printf("exact inference, 2 threads: %8s %12s %14s %12s\n", "scans", "points",
                "s measuring", "s inference");
    std::vector<uint32_t> all;
    for (size_t t = 0; t < count; ++t) {
      if ((*scene)->measurable().Test(t)) all.push_back(static_cast<uint32_t>(t));
    }
    for (size_t n = 2; n <= plan.size(); n *= 2) {
      const std::span<const Measurement> scans = std::span(plan).first(n);
      std::vector<std::shared_ptr<const ScanPoints>> points(n);
      const Stopwatch measuring;
      ParallelFor(2, n, [&](size_t i) {
        points[i] = (*scene)->MeasureForInference(scans[i], nullptr).points;
      });
      const double measuring_s = measuring.Seconds();
      int64_t total = 0;
      std::vector<TargetUncertainty> u(all.size());
      const Stopwatch inference;
      ParallelFor(2, (all.size() + 63) / 64, [&](size_t b) {
        const size_t begin = b * 64, size = std::min<size_t>(64, all.size() - begin);
        (*scene)->Infer(points, std::span(all).subspan(begin, size), false, {},
                        std::span(u).subspan(begin, size), nullptr);
      });
      const double inference_s = inference.Seconds();
      for (const TargetUncertainty& target : u) total += target.points;
      std::printf("%27s %8zu %12lld %14.2f %12.2f\n", "", n, static_cast<long long>(total),
                  measuring_s, inference_s);
      results.push_back({{"targets", count},
                         {"scans", n},
                         {"points_told", total},
                         {"measuring_s", measuring_s},
                         {"inference_s", inference_s}});
    }
  }
  std::filesystem::remove_all(folder);
  WriteResults(json, "uncertainty_queries", results);
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("Gain queries by uncertainty beside those by coverage");
  double seconds = 3;
  int rounds = 3;
  std::vector<int> targets = {20000, 40000};
  std::string json;
  app.add_option("--seconds", seconds, "of every measurement");
  app.add_option("--rounds", rounds);
  app.add_option("--targets", targets)->delimiter(',');
  app.add_option("--json", json);
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(seconds, rounds, targets, json);
}
