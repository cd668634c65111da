// SPDX-License-Identifier: Apache-2.0
// Gain queries while the replicas that answer them are killed: none lost, none wrong.
//
// Two coverage servers, some clients that know both addresses. A server is killed (SIGKILL) at
// random moments and started again at once; it has forgotten its scene then. Every answer is
// compared with that of a server that nobody disturbed. Memory must not grow: that of this process
// after a fifth of the queries and at the end, and the largest of the servers in either half.
#include <signal.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <fstream>
#include <memory>
#include <random>
#include <span>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "bench/common/measure.h"
#include "bench/common/parts.h"
#include "bench/common/scans.h"
#include "bench/common/server_process.h"
#include "planner_client/coverage_client/coverage_client.h"

namespace sightline::bench {
namespace {

std::unique_ptr<CoverageClient> Connect(const std::string& address,
                                        std::shared_ptr<const TriangleMesh> mesh,
                                        double spacing_m) {
  CoverageClientOptions options;
  options.address = address;
  options.retry_for = absl::Seconds(120);
  CoverageTask task;
  task.part = std::move(mesh);
  task.sampling.spacing_m = spacing_m;
  auto client = CoverageClient::Open(options, task);
  if (!client.ok()) Fail("connect", std::string(client.status().message()));
  return *std::move(client);
}

double ResidentMiB(pid_t pid) {
  std::ifstream file(absl::StrCat("/proc/", pid, "/statm"));
  double size_pages = 0, resident_pages = 0;
  file >> size_pages >> resident_pages;
  return resident_pages * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20);
}

// Kills one of two servers now and then, until it is told to end.
class Killer {
 public:
  Killer(std::array<std::unique_ptr<ServerProcess>, 2>* replicas, double mean_s, uint64_t seed)
      : replicas_(replicas), mean_s_(mean_s), generator_(seed), thread_([this] { Work(); }) {}
  ~Killer() { Stop(); }
  int Stop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
    return kills_;
  }
  // The largest resident memory of a server until now; starts anew.
  double TakeLargestMiB() { return largest_mib_.exchange(0); }

 private:
  void Work() {
    std::exponential_distribution<double> pause(1 / mean_s_);
    std::uniform_int_distribution<size_t> which(0, 1);
    while (!stop_) {
      const Stopwatch watch;
      const double seconds = pause(generator_);
      while (!stop_ && watch.Seconds() < seconds) {
        for (const auto& replica : *replicas_) {
          largest_mib_ = std::max<double>(largest_mib_, ResidentMiB(replica->pid()));
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
      }
      if (stop_) return;
      std::unique_ptr<ServerProcess>& replica = (*replicas_)[which(generator_)];
      const std::string address = replica->address();
      kill(replica->pid(), SIGKILL);
      replica.reset();
      replica = std::make_unique<ServerProcess>(address);
      ++kills_;
    }
  }

  std::array<std::unique_ptr<ServerProcess>, 2>* replicas_;
  const double mean_s_;
  std::mt19937_64 generator_;
  std::atomic<bool> stop_ = false;
  std::atomic<double> largest_mib_ = 0;
  int kills_ = 0;
  std::thread thread_;
};

bool Same(const ScanGain& a, const ScanGain& b) {
  return a.feasibility == b.feasibility && a.new_targets == b.new_targets &&
         a.covered_targets == b.covered_targets && a.gain == b.gain;
}

int Run(int64_t queries, int clients, double mean_s, uint64_t seed, const std::string& json) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  PrintMachine();
  const std::shared_ptr<const TriangleMesh> mesh = LoadBenchPart("head");
  const double spacing_m = SpacingForTargets(*mesh, 4000);
  const std::unique_ptr<CoverageScene> scene = BuildScene(*mesh, spacing_m);
  constexpr size_t kScansPerCall = 2048;
  const std::vector<Measurement> scans = RandomScans(*scene, 8 * kScansPerCall, seed);

  std::vector<ScanGain> truth;
  std::vector<float> known;
  {
    ServerProcess undisturbed("127.0.0.1:0");
    const auto client = Connect(undisturbed.address(), mesh, spacing_m);
    known.assign(client->targets().size(), 0);
    auto gains = client->Gains(scans, known);
    if (!gains.ok()) Fail("reference", std::string(gains.status().message()));
    truth = *std::move(gains);
  }
  std::array<std::unique_ptr<ServerProcess>, 2> replicas = {
      std::make_unique<ServerProcess>("127.0.0.1:0"),
      std::make_unique<ServerProcess>("127.0.0.1:0")};
  // In different orders, so that both have work.
  const std::string addresses[] = {
      absl::StrCat("ipv4:", replicas[0]->address(), ",", replicas[1]->address()),
      absl::StrCat("ipv4:", replicas[1]->address(), ",", replicas[0]->address())};
  std::vector<std::unique_ptr<CoverageClient>> connected;
  for (int i = 0; i < clients; ++i) {
    connected.push_back(Connect(addresses[i % 2], mesh, spacing_m));
  }
  Killer killer(&replicas, mean_s, seed);
  const Stopwatch watch;
  std::atomic<int64_t> asked = 0, answered = 0, wrong = 0, lost = 0;
  std::atomic<double> own_early_mib = 0, servers_early_mib = 0;
  ParallelFor(clients, static_cast<size_t>(clients), [&](size_t number) {
    CoverageClient& client = *connected[number];
    for (size_t call = number; asked < queries; ++call) {
      asked += kScansPerCall;
      const size_t begin = call % (scans.size() / kScansPerCall) * kScansPerCall;
      const auto gains = client.Gains(std::span(scans).subspan(begin, kScansPerCall), known);
      if (!gains.ok()) {
        std::printf("lost: %s\n", std::string(gains.status().message()).c_str());
        lost += kScansPerCall;
        continue;
      }
      for (size_t i = 0; i < kScansPerCall; ++i) wrong += !Same((*gains)[i], truth[begin + i]);
      const int64_t now = answered += kScansPerCall;
      double unset = 0;
      if (5 * now > queries) own_early_mib.compare_exchange_strong(unset, ResidentMiB(getpid()));
      unset = 0;
      if (2 * now > queries && servers_early_mib == 0) servers_early_mib = killer.TakeLargestMiB();
    }
  });
  const double seconds = watch.Seconds();
  const int kills = killer.Stop();
  const double own_mib = ResidentMiB(getpid()), servers_mib = killer.TakeLargestMiB();
  int recoveries = 0;
  for (const auto& client : connected) recoveries += client->recoveries();
  std::printf(
      "%lld queries of %d clients in %.1f s, %d servers killed, scene made again %d times: %lld "
      "lost, %lld wrong; memory of the clients %.0f MiB early, %.0f MiB at the end, largest of a "
      "server %.0f MiB in the first half, %.0f MiB in the second\n",
      static_cast<long long>(answered), clients, seconds, kills, recoveries,
      static_cast<long long>(lost), static_cast<long long>(wrong), own_early_mib.load(), own_mib,
      servers_early_mib.load(), servers_mib);
  WriteResults(json, "replica_faults",
               {{"queries", answered.load()},
                {"clients", clients},
                {"seconds", seconds},
                {"kills", kills},
                {"recoveries", recoveries},
                {"lost", lost.load()},
                {"wrong", wrong.load()},
                {"clients_early_mib", own_early_mib.load()},
                {"clients_end_mib", own_mib},
                {"server_first_half_mib", servers_early_mib.load()},
                {"server_second_half_mib", servers_mib}});
  // A tenth and what an allocator keeps for itself.
  const auto flat = [](double early, double late) { return late < 1.1 * early + 16; };
  const bool memory_is_flat = flat(own_early_mib, own_mib) && flat(servers_early_mib, servers_mib);
  return lost + wrong == 0 && kills > 0 && memory_is_flat ? 0 : 1;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app{"Gain queries while the replicas that answer them are killed"};
  int64_t queries = 1000000;
  int clients = 4;
  double mean_s = 5;
  uint64_t seed = 1;
  std::string json;
  app.add_option("--queries", queries)->check(CLI::Range(1, 1000000000));
  app.add_option("--clients", clients, "that ask at a time")->check(CLI::Range(1, 64));
  app.add_option("--mean-s", mean_s, "mean time between two kills")->check(CLI::PositiveNumber);
  app.add_option("--seed", seed);
  app.add_option("--json", json, "file for the results");
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(queries, clients, mean_s, seed, json);
}
