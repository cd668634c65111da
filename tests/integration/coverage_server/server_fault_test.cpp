// SPDX-License-Identifier: Apache-2.0
// Coverage servers as processes while parts of the world fail: workers, clients, memory, network,
// clocks. Afterwards nothing accepted is lost, and the same request succeeds.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <future>
#include <map>
#include <sstream>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "planner_client/coverage_client/coverage_client.h"
#include "planner_client/embedded_server/embedded_server.h"
#include "tests/integration/coverage_server/service_fixture.h"
#include "tests/integration/coverage_server/slow_proxy.h"
#include "tests/integration/run_process.h"
#include "tests/integration/test_certificates.h"
#include "tests/limits/cpu_time.h"
#include "tests/limits/wait_until.h"
#include "tests/limits/within_limits.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

std::vector<pid_t> ChildrenOf(pid_t pid) {
  std::vector<pid_t> children;
  std::error_code error;
  const std::string tasks = absl::StrCat("/proc/", pid, "/task");
  for (const auto& task : std::filesystem::directory_iterator(tasks, error)) {
    std::ifstream file(task.path() / "children");
    for (pid_t child = 0; file >> child;) children.push_back(child);
  }
  return children;
}

int64_t PeakMemoryBytes(pid_t pid) {
  std::ifstream file(absl::StrCat("/proc/", pid, "/status"));
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("VmHWM:", 0) == 0) return std::stoll(line.substr(6)) * 1024;
  }
  return 0;
}

class ServerFaultTest : public ::testing::Test {
 protected:
  ServerFaultTest() {
    unsetenv("SIGHTLINE_FAKE_DEAF");
    SetFake(0, 0);
  }
  static void SetFake(int query_ms, int build_ms) {
    setenv("SIGHTLINE_FAKE_QUERY_MS", absl::StrCat(query_ms).c_str(), 1);
    setenv("SIGHTLINE_FAKE_BUILD_MS", absl::StrCat(build_ms).c_str(), 1);
  }

  void Start(const std::string& program, std::vector<std::string> arguments = {}) {
    EmbeddedServerOptions options;
    options.binary = BinFolder() + "/" + program;
    options.arguments = std::move(arguments);
    auto server = EmbeddedServer::Start(options);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    connection_ = std::make_unique<Connection>(server_->address());
  }

  v1::Job Get(const std::string& job_id) {
    grpc::ClientContext context;
    Connection::SetTimeout(&context);
    v1::GetJobRequest request;
    request.set_job_id(job_id);
    v1::GetJobResponse response;
    const grpc::Status status = connection_->jobs->GetJob(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response.job();
  }
  bool Finished(const std::string& job_id) {
    return Get(job_id).state() >= v1::Job::STATE_SUCCEEDED;
  }
  void Cancel(const std::string& job_id) {
    grpc::ClientContext context;
    Connection::SetTimeout(&context);
    v1::CancelJobRequest request;
    request.set_job_id(job_id);
    v1::CancelJobResponse ignored;
    EXPECT_TRUE(connection_->jobs->CancelJob(&context, request, &ignored).ok());
  }
  // All that the fast estimate says of some scans: hangs on every byte of the field.
  std::string FieldAnswers(const std::string& scene) {
    grpc::ClientContext context;
    Connection::SetTimeout(&context);
    v1::EvaluateCoverageRequest request;
    request.set_scene_digest(scene);
    request.set_evaluator(v1::EVALUATOR_FAST);
    for (int i = 0; i < 400; ++i) *request.add_measurements() = MakeMeasurement(i);
    v1::EvaluateCoverageResponse response;
    const grpc::Status status =
        connection_->coverage->EvaluateCoverage(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response.SerializeAsString();
  }

  std::unique_ptr<EmbeddedServer> server_;
  std::unique_ptr<Connection> connection_;
};

class FieldWorkerTest : public ServerFaultTest {
 protected:
  // Long enough in its field for workers to be found.
  v1::SceneSpec Spec() {
    v1::SceneSpec spec = connection_->UploadBox({0.06f, 0.04f, 0.02f});
    spec.mutable_targets()->set_spacing_m(0.002);
    spec.set_field_directions(96 * 96);
    return spec;
  }
};

TEST_F(FieldWorkerTest, KilledWorkersAreReplacedAndTheBytesAreTheSame) {
  Start("coverage_server", {"--threads", "2"});
  const std::string undisturbed = FieldAnswers(connection_->MakeScene(Spec()));
  Start("coverage_server", {"--threads", "2"});
  const auto job = connection_->CreateScene(Spec());
  ASSERT_TRUE(job.ok()) << job.status();
  int killed = 0;
  for (const double progress : {0.1, 0.3, 0.6}) {
    WaitUntil([&] { return Get(job->job_id()).progress() > progress; });
    const std::vector<pid_t> workers = ChildrenOf(server_->pid());
    if (workers.empty()) break;
    ASSERT_GT(workers[0], 1);
    if (kill(workers[0], SIGKILL) == 0) ++killed;
  }
  WaitUntil([&] { return Finished(job->job_id()); });
  const v1::Job done = Get(job->job_id());
  EXPECT_EQ(done.state(), v1::Job::STATE_SUCCEEDED) << done.ShortDebugString();
  EXPECT_GE(killed, 1);
  EXPECT_EQ(FieldAnswers(done.result_key()), undisturbed);
}

TEST_F(FieldWorkerTest, WorkersThatAreKilledForEverEndTheJobOnly) {
  Start("coverage_server", {"--threads", "2"});
  const v1::SceneSpec spec = Spec();
  const auto job = connection_->CreateScene(spec);
  ASSERT_TRUE(job.ok()) << job.status();
  WaitUntil([&] {
    for (const pid_t worker : ChildrenOf(server_->pid())) {
      if (worker > 1) kill(worker, SIGKILL);
    }
    return Finished(job->job_id());
  });
  const v1::Job failed = Get(job->job_id());
  EXPECT_EQ(failed.state(), v1::Job::STATE_FAILED);
  EXPECT_EQ(failed.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_THAT(failed.error_message(), HasSubstr("by signal 9"));
  EXPECT_FALSE(connection_->MakeScene(spec).empty());
}

// 0.5 mm on 0.13 m2: hundreds of thousands of targets, and seconds in every stage.
class CancelTest : public ServerFaultTest {
 protected:
  v1::SceneSpec Spec() {
    v1::SceneSpec spec = connection_->UploadBox({0.15f, 0.15f, 0.15f});
    spec.mutable_targets()->set_spacing_m(0.0005);
    spec.set_field_directions(256);
    return spec;
  }
};

TEST_F(CancelTest, EveryStageOfASceneStopsSoon) {
  Start("coverage_server", {"--threads", "2"});
  const v1::SceneSpec spec = Spec();
  std::map<std::string, double> longest_s;
  // Progress is reported when a stage begins: the pauses lead into it, and into what lies between.
  for (const char* stage :
       {"sampling targets", "rendering the visibility field", "deciding measurability"}) {
    for (const int pause_ms : {0, 300, 900}) {
      const auto job = connection_->CreateScene(spec);
      ASSERT_TRUE(job.ok()) << job.status();
      WaitUntil([&] {
        const v1::Job now = Get(job->job_id());
        return now.message() == stage || now.state() >= v1::Job::STATE_SUCCEEDED;
      });
      absl::SleepFor(absl::Milliseconds(pause_ms));
      Cancel(job->job_id());
      // After the answer: the call itself may take long where other programs run.
      const double before_s = FamilyCpuSeconds(server_->pid());
      ASSERT_TRUE(connection_->Watch(job->job_id()).ok());
      longest_s[stage] = std::max(longest_s[stage], FamilyCpuSeconds(server_->pid()) - before_s);
      const v1::Job ended = Get(job->job_id());
      if (ended.state() == v1::Job::STATE_SUCCEEDED) return;  // no later stage can be caught
      EXPECT_EQ(ended.state(), v1::Job::STATE_CANCELLED);
    }
  }
  for (const auto& [stage, time_s] : longest_s) {
    std::printf("%s: stopped after %.2f s of CPU time\n", stage.c_str(), time_s);
    // Each of two threads works for a tenth of a second; what is made so far is freed after that.
    EXPECT_LT(time_s, 1.0 * kSlowness) << stage;
  }
  EXPECT_LT(PeakMemoryBytes(server_->pid()), int64_t{3} << 30);
}

TEST_F(CancelTest, SigtermIsObeyedWhileASceneIsBuilt) {
  Start("coverage_server", {"--threads", "2", "--drain-seconds", "2"});
  const auto job = connection_->CreateScene(Spec());
  ASSERT_TRUE(job.ok()) << job.status();
  WaitUntil([&] {
    const v1::Job now = Get(job->job_id());
    return now.message() == "sampling targets" || now.state() >= v1::Job::STATE_SUCCEEDED;
  });
  absl::SleepFor(absl::Milliseconds(300));
  ASSERT_GT(server_->pid(), 1);
  ASSERT_EQ(kill(server_->pid(), SIGTERM), 0);
  WaitUntil([&] { return !server_->CheckAlive().ok(); });
  EXPECT_THAT(std::string(server_->CheckAlive().message()), HasSubstr("exit code 0"));
}

TEST_F(ServerFaultTest, WorkThatDoesNotStopCannotHoldUpTheEnd) {
  setenv("SIGHTLINE_FAKE_DEAF", "1", 1);
  SetFake(0, /*build_ms=*/24 * 3600 * 1000);
  Start("fake_coverage_server", {"--drain-seconds", "0.5"});
  unsetenv("SIGHTLINE_FAKE_DEAF");
  const auto job = connection_->CreateScene(connection_->UploadBox());
  ASSERT_TRUE(job.ok()) << job.status();
  WaitUntil([&] { return Get(job->job_id()).state() == v1::Job::STATE_RUNNING; });
  ASSERT_GT(server_->pid(), 1);
  ASSERT_EQ(kill(server_->pid(), SIGTERM), 0);
  // After the drain and the three seconds that work has to stop.
  WaitUntil([&] { return !server_->CheckAlive().ok(); });
  EXPECT_THAT(std::string(server_->CheckAlive().message()), HasSubstr("event=stopped_hard"));
}

TEST_F(ServerFaultTest, LackOfMemoryFailsTheJobAndNotTheServer) {
  Start("coverage_server", {"--threads", "1"});
  v1::SceneSpec spec = connection_->UploadBox({0.2f, 0.2f, 0.2f});
  spec.mutable_targets()->set_spacing_m(0.0005);
  spec.set_field_directions(256);
  // Threads and calls get what they need; hundreds of megabytes for candidates are too much.
  rlimit before{};
  ASSERT_GT(server_->pid(), 1);
  std::ifstream statm(absl::StrCat("/proc/", server_->pid(), "/statm"));
  rlim_t pages = 0;
  ASSERT_TRUE(statm >> pages);
  const rlim_t used = pages * static_cast<rlim_t>(sysconf(_SC_PAGESIZE));
  ASSERT_EQ(prlimit(server_->pid(), RLIMIT_AS, nullptr, &before), 0);
  const rlimit tight = {used + (rlim_t{160} << 20), before.rlim_max};
  ASSERT_EQ(prlimit(server_->pid(), RLIMIT_AS, &tight, nullptr), 0);
  const auto job = connection_->CreateScene(spec);
  ASSERT_TRUE(job.ok()) << job.status();
  WaitUntil([&] { return Finished(job->job_id()); });
  const v1::Job failed = Get(job->job_id());
  EXPECT_EQ(failed.state(), v1::Job::STATE_FAILED);
  EXPECT_EQ(failed.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED) << failed.error_message();
  EXPECT_TRUE(server_->CheckAlive().ok());
  ASSERT_EQ(prlimit(server_->pid(), RLIMIT_AS, &before, nullptr), 0);
  spec.mutable_targets()->set_spacing_m(0.005);
  EXPECT_FALSE(connection_->MakeScene(spec).empty());
}

TEST_F(ServerFaultTest, SlowAndBrokenNetworksLoseNothing) {
  Start("fake_coverage_server");
  CoverageTask task;
  task.part = LoadedBox({0.1f, 0.2f, 0.3f});
  CoverageClientOptions direct;
  direct.address = server_->address();
  auto near = CoverageClient::Open(direct, task);
  ASSERT_TRUE(near.ok()) << near.status();
  const auto expected = (*near)->Gains(Measurements(2000), std::vector<float>(1000));
  ASSERT_TRUE(expected.ok()) << expected.status();

  SlowProxy proxy(server_->address().substr(5), /*bytes_per_s=*/60000);
  CoverageClientOptions far = direct;
  far.address = proxy.address();
  far.retry_for = absl::Hours(24);
  auto client = CoverageClient::Open(far, task);
  ASSERT_TRUE(client.ok()) << client.status();
  auto asked = std::async(std::launch::async, [&] {
    return (*client)->Gains(Measurements(2000), std::vector<float>(1000));
  });
  for (int i = 0; i < 3; ++i) {
    absl::SleepFor(absl::Milliseconds(400));
    proxy.CutConnections();
  }
  const auto answered = asked.get();
  ASSERT_TRUE(answered.ok()) << answered.status();
  EXPECT_EQ(NewTargets(*answered), NewTargets(*expected));
  EXPECT_GT(proxy.connections(), 1);
}

// Clients that vanish in the middle of an upload leave nothing behind.
TEST_F(ServerFaultTest, KilledClientsAreForgotten) {
  Start("fake_coverage_server", {"--max-part-bytes", "8MB"});
  for (int i = 0; i < 20; ++i) {
    SlowProxy proxy(server_->address().substr(5), /*bytes_per_s=*/20e6);
    Connection dying(proxy.address());
    grpc::ClientContext context;
    Connection::SetTimeout(&context);
    v1::UploadPartResponse ignored;
    auto writer = dying.coverage->UploadPart(&context, &ignored);
    v1::UploadPartRequest message;
    message.mutable_header()->set_format("ply");
    message.mutable_header()->set_unit("m");
    message.mutable_header()->set_size_bytes(8 << 20);
    writer->Write(message);
    message.set_chunk(std::string(1 << 20, 'x'));
    for (int chunk = 0; chunk < 7 && writer->Write(message); ++chunk) {
    }
    proxy.CutConnections();
    writer->Finish();
  }
  // More than what may be received at a time has gone through: once the server has noticed the
  // ends, nobody holds it any more.
  absl::Status status;
  WaitUntil([&] {
    v1::UploadPartResponse uploaded;
    status = connection_->Upload(EncodePly(MakeBox({0.1f, 0.1f, 0.1f})), "ply", "m", &uploaded);
    return !absl::IsUnavailable(status);
  });
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_LT(PeakMemoryBytes(server_->pid()), int64_t{400} << 20);
}

TEST_F(ServerFaultTest, AJumpOfTheClockChangesNothing) {
  TemporaryFolder folder;
  const std::string jump_file = folder.path() + "/jump";
  std::ofstream(jump_file) << "0";
  // Only the server's clock jumps.
  const std::string program = folder.path() + "/server";
  std::ofstream(program) << "#!/bin/sh\nSIGHTLINE_CLOCK_JUMP_FILE=" << jump_file
                         << " LD_PRELOAD=" << CLOCK_JUMP_LIBRARY << " exec " << BinFolder()
                         << "/fake_coverage_server \"$@\"\n";
  ASSERT_EQ(chmod(program.c_str(), 0700), 0);
  SetFake(/*query_ms=*/1000, /*build_ms=*/1500);
  EmbeddedServerOptions options;
  options.binary = program;
  auto server = EmbeddedServer::Start(options);
  ASSERT_TRUE(server.ok()) << server.status();
  server_ = *std::move(server);
  connection_ = std::make_unique<Connection>(server_->address());
  const v1::SceneSpec spec = connection_->UploadBox();
  for (const char* jump : {"86400", "-86400", "0"}) {
    v1::SceneSpec other = spec;
    other.mutable_targets()->set_seed(100 + std::atoi(jump));
    auto building = std::async(std::launch::async, [&] { return connection_->MakeScene(other); });
    absl::SleepFor(absl::Milliseconds(300));
    std::ofstream(jump_file) << jump << std::flush;
    const std::string scene = building.get();
    EXPECT_FALSE(scene.empty()) << jump;
    // A call under way when the clock goes on by two days.
    auto asking = std::async(std::launch::async, [&] {
      v1::EvaluateGainsResponse response;
      return connection_->Gains(GainsRequest(scene, 3), &response);
    });
    absl::SleepFor(absl::Milliseconds(300));
    std::ofstream(jump_file) << std::atoi(jump) + 2 * 86400 << std::flush;
    const absl::Status status = asking.get();
    EXPECT_TRUE(status.ok()) << jump << ": " << status;
  }
}

TEST_F(ServerFaultTest, AServerKilledBeforeItListensIsRestartedOnce) {
  TemporaryFolder folder;
  const std::string program = folder.path() + "/server";
  const auto dies = [&](int times) {
    std::ofstream(folder.path() + "/left") << times << "\n";
    std::ofstream(program) << "#!/bin/sh\nleft=$(cat " << folder.path() << "/left)\n"
                           << "echo $((left - 1)) > " << folder.path() << "/left\n"
                           << "[ $left -gt 0 ] && kill -9 $$\nexec " << BinFolder()
                           << "/fake_coverage_server \"$@\"\n";
    chmod(program.c_str(), 0700);
  };
  EmbeddedServerOptions options;
  options.binary = program;
  dies(1);
  auto server = EmbeddedServer::Start(options);
  ASSERT_TRUE(server.ok()) << server.status();
  EXPECT_FALSE(Connection((*server)->address()).MakeScene().empty());
  // The server has used its one restart.
  ASSERT_GT((*server)->pid(), 1);
  ASSERT_EQ(kill((*server)->pid(), SIGKILL), 0);
  WaitUntil([&] { return !(*server)->CheckAlive().ok(); });
  const absl::Status again = (*server)->Restart();
  EXPECT_EQ(again.code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(again.message()), HasSubstr("restarted once before"));
  dies(2);
  const absl::Status dead = EmbeddedServer::Start(options).status();
  EXPECT_EQ(dead.code(), absl::StatusCode::kUnavailable) << dead;
  EXPECT_THAT(std::string(dead.message()), HasSubstr("was killed by signal 9"));
}

// In its first moments, whatever it is doing: between its start and the end of the first scene.
TEST_F(ServerFaultTest, AServerKilledInItsFirstSecondIsRestarted) {
  SetFake(0, /*build_ms=*/200);
  for (const int after_ms : {0, 5, 20, 60, 150, 250}) {
    Start("fake_coverage_server");
    CoverageTask task;
    task.part = LoadedBox({0.1f, 0.2f, 0.3f});
    CoverageClientOptions options;
    options.embedded = server_.get();
    const pid_t first = server_->pid();
    ASSERT_GT(first, 1);
    std::thread killer([&] {
      absl::SleepFor(absl::Milliseconds(after_ms));
      kill(first, SIGKILL);
    });
    auto client = CoverageClient::Open(options, task);
    killer.join();
    ASSERT_TRUE(client.ok()) << after_ms << ": " << client.status();
    const auto gains = (*client)->Gains(Measurements(10), std::vector<float>(1000));
    EXPECT_TRUE(gains.ok()) << after_ms << ": " << gains.status();
    EXPECT_NE(server_->pid(), first);
  }
}

TEST_F(ServerFaultTest, ProgressIsReportedWithinOpenOnly) {
  SetFake(0, /*build_ms=*/100);
  Start("fake_coverage_server");
  CoverageTask task;
  task.part = LoadedBox({0.1f, 0.2f, 0.3f});
  auto reports = std::make_unique<int>(0);
  std::unique_ptr<CoverageClient> client;
  {
    CoverageClientOptions options;
    options.embedded = server_.get();
    options.on_progress = [&](double, const std::string&) { ++*reports; };
    auto opened = CoverageClient::Open(options, task);
    ASSERT_TRUE(opened.ok()) << opened.status();
    client = *std::move(opened);
  }
  EXPECT_GT(*reports, 0);
  // The callback's data may be destroyed now: sanitizers and a null pointer see it if it is used.
  reports.reset();
  ASSERT_GT(server_->pid(), 1);
  ASSERT_EQ(kill(server_->pid(), SIGKILL), 0);
  const auto gains = client->Gains(Measurements(10), std::vector<float>(1000));
  EXPECT_TRUE(gains.ok()) << gains.status();
  EXPECT_EQ(client->recoveries(), 1);
}

// `sightline` with a coverage server that asks for certificates.
class TlsCommandTest : public ServerFaultTest {
 protected:
  std::string Write(const std::string& name, const std::string& text) {
    const std::string path = folder_.path() + "/" + name;
    std::ofstream(path) << text;
    return path;
  }
  ProcessResult Plan(const std::string& options) {
    return RunProcess(absl::StrCat("cd ", folder_.path(), " && ", BinFolder(),
                                   "/sightline plan inspection.json --out out --no-pictures "
                                   "--no-point-clouds --evaluations-per-scan 200 "
                                   "--field-directions 576 ",
                                   options));
  }

  TemporaryFolder folder_;
};

TEST_F(TlsCommandTest, CommandsUseTls) {
  const TestAuthority authority("plant"), stranger("stranger");
  const PemPair server = authority.Issue("coverage", "DNS:coverage.plant");
  const PemPair client = authority.Issue("planner");
  const std::string ca = Write("ca.pem", authority.certificate());
  const std::string certificate = Write("client.pem", client.certificate);
  const std::string key = Write("client.key", client.key);
  Write("box.ply", EncodePly(MakeBox({0.06f, 0.04f, 0.02f})));
  Write("inspection.json", R"({"name": "box", "part": {"file": "box.ply", "unit": "m"},
    "targets": {"spacing_m": 0.005}, "goal": {"coverage": 0.5}})");
  Start("coverage_server", {"--tls-cert", Write("server.pem", server.certificate), "--tls-key",
                            Write("server.key", server.key), "--tls-client-ca", ca});
  const std::string at = "--coverage-server " + server_->address() + " ";
  const std::string name = "--tls-server-name coverage.plant ";
  const std::string own = "--tls-cert " + certificate + " --tls-key " + key + " ";

  const ProcessResult done = Plan(at + "--tls-ca " + ca + " " + name + own);
  EXPECT_EQ(done.exit_code, 0) << done.output;
  EXPECT_TRUE(std::filesystem::exists(folder_.path() + "/out/plan.json"));
  // Without TLS, without a certificate, with another's authority, for another name.
  for (const std::string& wrong :
       {std::string(), "--tls-ca " + ca + " " + name,
        "--tls-ca " + Write("stranger.pem", stranger.certificate()) + " " + name + own,
        "--tls-ca " + ca + " --tls-server-name other.plant " + own}) {
    const ProcessResult refused = Plan(at + wrong);
    EXPECT_EQ(refused.exit_code, 1) << wrong << refused.output;
    EXPECT_THAT(refused.output, HasSubstr("coverage server " + server_->address()));
  }
  EXPECT_THAT(Plan(at + "--tls-ca /nonexistent").output,
              HasSubstr("--tls-ca: /nonexistent is not a readable PEM file"));
  EXPECT_THAT(Plan(at + own).output, HasSubstr("need --tls-ca"));
  const ProcessResult nowhere = Plan("--tls-ca " + ca);
  EXPECT_EQ(nowhere.exit_code, 2);
  EXPECT_THAT(nowhere.output, HasSubstr("give its address, too"));
}

}  // namespace
}  // namespace sightline
