// Gain queries while the replicas that answer them are killed: none lost, none wrong.
//
// Two coverage servers, one client that knows both addresses. A server is killed (SIGKILL) at
// random moments and started again at once; it has forgotten its scene then. Every answer is
// compared with that of a server that nobody disturbed.
#include <signal.h>

#include <CLI/CLI.hpp>
#include <array>
#include <atomic>
#include <cstdio>
#include <memory>
#include <random>
#include <thread>

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

 private:
  void Work() {
    std::exponential_distribution<double> pause(1 / mean_s_);
    std::uniform_int_distribution<size_t> which(0, 1);
    while (!stop_) {
      const Stopwatch watch;
      const double seconds = pause(generator_);
      while (!stop_ && watch.Seconds() < seconds) {
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
  int kills_ = 0;
  std::thread thread_;
};

bool Same(const ScanGain& a, const ScanGain& b) {
  return a.feasibility == b.feasibility && a.new_targets == b.new_targets &&
         a.covered_targets == b.covered_targets && a.gain == b.gain;
}

int Run(int64_t queries, double mean_s, uint64_t seed, const std::string& json) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  PrintMachine();
  const std::shared_ptr<const TriangleMesh> mesh = LoadBenchPart("head");
  const double spacing_m = SpacingForTargets(*mesh, 4000);
  const std::unique_ptr<CoverageScene> scene = BuildScene(*mesh, spacing_m);
  const std::vector<Measurement> scans = RandomScans(*scene, 16384, seed);

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
  const auto client = Connect(
      absl::StrCat("ipv4:", replicas[0]->address(), ",", replicas[1]->address()), mesh, spacing_m);
  Killer killer(&replicas, mean_s, seed);
  const Stopwatch watch;
  int64_t answered = 0, wrong = 0, lost = 0;
  while (answered + lost < queries) {
    const auto gains = client->Gains(scans, known);
    if (!gains.ok()) {
      std::printf("lost: %s\n", std::string(gains.status().message()).c_str());
      lost += static_cast<int64_t>(scans.size());
      continue;
    }
    for (size_t i = 0; i < scans.size(); ++i) wrong += !Same((*gains)[i], truth[i]);
    answered += static_cast<int64_t>(scans.size());
  }
  const double seconds = watch.Seconds();
  const int kills = killer.Stop();
  std::printf(
      "%lld queries in %.1f s, %d servers killed, scene made again %d times: %lld lost, %lld "
      "wrong\n",
      static_cast<long long>(answered), seconds, kills, client->recoveries(),
      static_cast<long long>(lost), static_cast<long long>(wrong));
  WriteResults(json, "replica_faults",
               {{"queries", answered},
                {"seconds", seconds},
                {"kills", kills},
                {"recoveries", client->recoveries()},
                {"lost", lost},
                {"wrong", wrong}});
  return lost + wrong == 0 && kills > 0 ? 0 : 1;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app{"Gain queries while the replicas that answer them are killed"};
  int64_t queries = 1000000;
  double mean_s = 5;
  uint64_t seed = 1;
  std::string json;
  app.add_option("--queries", queries)->check(CLI::Range(1, 1000000000));
  app.add_option("--mean-s", mean_s, "mean time between two kills")->check(CLI::PositiveNumber);
  app.add_option("--seed", seed);
  app.add_option("--json", json, "file for the results");
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(queries, mean_s, seed, json);
}
