// SPDX-License-Identifier: Apache-2.0
// Gain queries per second: the fast evaluator in this process, through gRPC against a real server,
// and Embree; time of an exact query. All on the same scans, taking turns.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <thread>

#include "bench/common/embree_coverage.h"
#include "bench/common/measure.h"
#include "bench/common/parts.h"
#include "bench/common/scans.h"
#include "bench/common/server_process.h"
#include "coverage_server/scan/scan_in_part.h"
#include "planner_client/coverage_client/coverage_client.h"

namespace sightline::bench {
namespace {

constexpr size_t kBatch = 64;

struct Rate {
  double queries_per_s = 0;
  double cpu_us_per_query = 0;  // of client and server together
};

struct Peer {
  std::string name;
  std::function<Rate(double seconds)> run;
  std::vector<Rate> rates;
};

// `work(batch)` is called with batches of the scans from each of `threads` threads.
Rate RunThreads(int threads, double seconds, const std::vector<Measurement>& scans,
                const std::function<void(std::span<const Measurement>)>& work) {
  const double cpu = OwnCpuSeconds();
  const Stopwatch watch;
  std::atomic<int64_t> queries = 0;
  const size_t batches = scans.size() / kBatch;
  ParallelFor(threads, static_cast<size_t>(threads), [&](size_t t) {
    // Threads start at different places, as independent clients do.
    for (size_t b = t * batches / threads; watch.Seconds() < seconds; ++b) {
      work(std::span(scans).subspan(b % batches * kBatch, kBatch));
      queries += kBatch;
    }
  });
  const auto count = static_cast<double>(queries.load());
  return {count / watch.Seconds(), 1e6 * (OwnCpuSeconds() - cpu) / count};
}

std::vector<float> KnownOf(const TargetBits& covered) {
  std::vector<float> known(covered.size(), 0);
  AddShares(FullShares(covered), known);
  return known;
}

Rate RunClient(CoverageClient& client, pid_t server, double seconds,
               const std::vector<Measurement>& scans, const TargetBits& covered) {
  const std::vector<float> known = KnownOf(covered);
  const double cpu = OwnCpuSeconds() + ProcessCpuSeconds(server);
  const Stopwatch watch;
  double count = 0;
  while (watch.Seconds() < seconds) {
    const auto gains = client.Gains(scans, known);
    if (!gains.ok()) Fail("gRPC", std::string(gains.status().message()));
    count += static_cast<double>(gains->size());
  }
  return {count / watch.Seconds(),
          1e6 * (OwnCpuSeconds() + ProcessCpuSeconds(server) - cpu) / count};
}

std::unique_ptr<CoverageClient> Connect(const std::string& address, const TriangleMesh& mesh,
                                        double spacing_m) {
  CoverageClientOptions options;
  options.address = address;
  options.min_batch = options.max_batch = kBatch;
  CoverageTask task;
  task.part = std::make_shared<const TriangleMesh>(mesh);
  task.sampling.spacing_m = spacing_m;
  auto client = CoverageClient::Open(options, task);
  if (!client.ok()) Fail("gRPC", std::string(client.status().message()));
  return std::move(*client);
}

Json ExactTimes(const CoverageScene& scene, const std::vector<Measurement>& scans) {
  std::vector<double> ms, cpu_ms;
  for (const Measurement& m : scans) {
    const Stopwatch watch;
    const double cpu = OwnCpuSeconds();
    scene.EvaluateExact(m, nullptr, nullptr);
    ms.push_back(1e3 * watch.Seconds());
    cpu_ms.push_back(1e3 * (OwnCpuSeconds() - cpu));
  }
  const Stopwatch watch;
  ParallelFor(2, scans.size(), [&](size_t i) { scene.EvaluateExact(scans[i], nullptr, nullptr); });
  return {{"queries", scans.size()},
          {"median_ms", Median(ms)},
          {"p95_ms", Quantile(ms, 0.95)},
          {"max_ms", Quantile(ms, 1)},
          {"median_cpu_ms", Median(cpu_ms)},
          {"p95_cpu_ms", Quantile(cpu_ms, 0.95)},
          {"two_threads_queries_per_s", static_cast<double>(scans.size()) / watch.Seconds()}};
}

int Run(double seconds, int rounds, int targets, int exact_queries, const std::string& json) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  PrintMachine();
  const std::unique_ptr<TriangleMesh> mesh = LoadBenchPart("head");
  const double spacing_m = SpacingForTargets(*mesh, targets);
  const std::unique_ptr<CoverageScene> scene = BuildScene(*mesh, spacing_m);
  std::printf(
      "cylinder head: %zu triangles, spacing %.3f mm, %zu targets (%lld measurable), field %.0f "
      "MB\n",
      mesh->triangles.size(), 1e3 * spacing_m, scene->targets().size(),
      static_cast<long long>(scene->measurable().Count()),
      static_cast<double>(scene->field_bytes()) / 1e6);

  int64_t tried = 0;
  const std::vector<Measurement> plan = GreedyPlanScans(*scene, 0.9, 2000, 1);
  const std::vector<std::pair<std::string, std::vector<Measurement>>> mixes = {
      {"random feasible scans", RandomScans(*scene, 2048, 1, &tried)},
      {"good scans", Perturbed(*scene, plan, 2048, 0.01, 2)}};
  std::printf(
      "random: 2048 of %lld drawn are feasible and cover something; good: %zu scans of a "
      "greedy plan, each parameter moved by 1 %% of its range\n",
      static_cast<long long>(tried), plan.size());
  // As in the middle of a greedy plan.
  std::vector<FastCoverage> first(plan.size() / 2);
  scene->EvaluateFastCoverage(std::span(plan).first(first.size()), first, nullptr);
  TargetBits covered(scene->targets().size());
  for (const FastCoverage& c : first) covered |= c.covered;

  const std::string folder =
      std::filesystem::temp_directory_path() / ("sightline-bench-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  Json results{{"triangles", mesh->triangles.size()},
               {"spacing_m", spacing_m},
               {"targets", scene->targets().size()},
               {"measurable", scene->measurable().Count()},
               {"batch", kBatch},
               {"seconds", seconds},
               {"rounds", rounds},
               {"mixes", Json::array()}};
  {
    const ServerProcess unix_server("unix:" + folder + "/coverage.sock");
    const ServerProcess tcp_server("127.0.0.1:0");
    const auto unix_client = Connect(unix_server.address(), *mesh, spacing_m);
    const auto tcp_client = Connect(tcp_server.address(), *mesh, spacing_m);

    const TriangleBvh bvh(*mesh);
    TargetSampling sampling;
    sampling.spacing_m = spacing_m;
    const SurfaceProbes probes = MakeSurfaceProbes(*mesh, bvh, scene->targets(), sampling);
    const EmbreeMesh embree_mesh(*mesh, 2);
    const EmbreeCoverage embree(embree_mesh, scene->targets(), probes);
    const auto cast = [&](const Measurement& m, int count) {
      TargetBits bits = embree.Covered(
          MakeScanInPart(scene->rig(), scene->part_centre_m(), m, PointLimits{}), count);
      bits &= scene->measurable();
      return bits.CountNotIn(covered);
    };

    for (const auto& entry : mixes) {
      const auto& mix = entry.first;
      const auto& scans = entry.second;
      const auto in_process = [&](std::span<const Measurement> batch) {
        std::vector<FastGain> gains(batch.size());
        scene->EvaluateGains(batch, &covered, {}, gains, nullptr);
      };
      const auto rays = [&](int count) {
        return [&, count](std::span<const Measurement> batch) {
          for (const Measurement& m : batch) cast(m, count);
        };
      };
      std::vector<Peer> peers = {
          {"fast, in process, 1 thread",
           [&](double s) { return RunThreads(1, s / 2, scans, in_process); },
           {}},
          {"fast, in process, 2 threads",
           [&](double s) { return RunThreads(2, s, scans, in_process); },
           {}},
          {"fast, gRPC, unix socket",
           [&](double s) { return RunClient(*unix_client, unix_server.pid(), s, scans, covered); },
           {}},
          {"fast, gRPC, TCP",
           [&](double s) { return RunClient(*tcp_client, tcp_server.pid(), s, scans, covered); },
           {}},
          {"Embree, target only, 1 thread",
           [&](double s) { return RunThreads(1, s / 2, scans, rays(1)); },
           {}},
          {"Embree, target only, 2 threads",
           [&](double s) { return RunThreads(2, s / 2, scans, rays(1)); },
           {}},
          {"Embree, 8 probes, 2 threads",
           [&](double s) { return RunThreads(2, s / 2, scans, rays(kProbesPerTarget)); },
           {}}};
      constexpr size_t kReference = 1;
      for (Peer& peer : peers) peer.run(0.3);
      for (int round = 0; round < rounds; ++round) {
        for (Peer& peer : peers) peer.rates.push_back(peer.run(seconds));
      }

      // The answers themselves.
      std::vector<FastGain> here(scans.size());
      scene->EvaluateGains(scans, &covered, {}, here, nullptr);
      const auto there = unix_client->Gains(scans, KnownOf(covered));
      if (!there.ok()) Fail("gRPC", std::string(there.status().message()));
      int64_t different = 0;
      for (size_t i = 0; i < scans.size(); ++i) {
        different += here[i].new_targets != (*there)[i].new_targets ||
                     here[i].covered_targets != (*there)[i].covered_targets;
      }
      double difference[2] = {0, 0};
      constexpr size_t kCompared = 256;
      for (size_t i = 0; i < kCompared; ++i) {
        for (int k = 0; k < 2; ++k) {
          difference[k] += std::abs(static_cast<double>(
              cast(scans[i], k == 0 ? 1 : kProbesPerTarget) - here[i].new_targets));
        }
      }
      for (double& d : difference) d /= static_cast<double>(kCompared * scene->targets().size());

      std::printf("\n%-32s %12s %10s %16s %10s\n", mix.c_str(), "queries/s", "of 2 thr.",
                  "CPU us/query", "of 2 thr.");
      Json rows = Json::array();
      for (const Peer& peer : peers) {
        std::vector<double> rate, ratio, cpu, cpu_ratio;
        for (size_t r = 0; r < peer.rates.size(); ++r) {
          const Rate& reference = peers[kReference].rates[r];
          rate.push_back(peer.rates[r].queries_per_s);
          ratio.push_back(peer.rates[r].queries_per_s / reference.queries_per_s);
          cpu.push_back(peer.rates[r].cpu_us_per_query);
          cpu_ratio.push_back(peer.rates[r].cpu_us_per_query / reference.cpu_us_per_query);
        }
        std::printf("%-32s %12.0f %9.2fx %16.1f %9.2fx\n", peer.name.c_str(), Median(rate),
                    Median(ratio), Median(cpu), Median(cpu_ratio));
        rows.push_back({{"name", peer.name},
                        {"queries_per_s", Median(rate)},
                        {"queries_per_s_rounds", rate},
                        {"ratio_to_in_process_2_threads", Median(ratio)},
                        {"cpu_us_per_query", Median(cpu)},
                        {"cpu_ratio_to_in_process_2_threads", Median(cpu_ratio)}});
      }
      std::printf(
          "gains through gRPC that differ from those in process: %lld of %zu; mean "
          "|Embree - fast| / targets: %.5f target only, %.5f with 8 probes\n",
          static_cast<long long>(different), scans.size(), difference[0], difference[1]);
      results["mixes"].push_back({{"mix", mix},
                                  {"peers", rows},
                                  {"grpc_gains_that_differ", different},
                                  {"embree_difference_target_only", difference[0]},
                                  {"embree_difference_8_probes", difference[1]}});
    }
  }
  std::filesystem::remove_all(folder);

  std::printf("\n%-32s %8s %10s %10s %10s %12s %12s %14s\n", "exact evaluator", "queries",
              "median ms", "p95 ms", "max ms", "median CPU", "p95 CPU", "2 threads q/s");
  for (size_t i = 0; i < mixes.size(); ++i) {
    const auto& [mix, scans] = mixes[i];
    const Json exact = ExactTimes(
        *scene, {scans.begin(), scans.begin() + std::min<size_t>(exact_queries, scans.size())});
    const auto value = [&](const char* key) { return exact[key].get<double>(); };
    std::printf("%-32s %8.0f %10.1f %10.1f %10.1f %12.1f %12.1f %14.1f\n", mix.c_str(),
                value("queries"), value("median_ms"), value("p95_ms"), value("max_ms"),
                value("median_cpu_ms"), value("p95_cpu_ms"), value("two_threads_queries_per_s"));
    results["mixes"][i]["exact"] = exact;
  }
  WriteResults(json, "gain_queries", results);
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("Fast and exact gain queries, in process, through gRPC and by Embree");
  double seconds = 10;
  int rounds = 2, targets = 20000, exact_queries = 200;
  std::string json;
  app.add_option("--seconds", seconds, "per round and gRPC peer; others take the same or half");
  app.add_option("--rounds", rounds);
  app.add_option("--targets", targets);
  app.add_option("--exact-queries", exact_queries);
  app.add_option("--json", json);
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(seconds, rounds, targets, exact_queries, json);
}
