// SPDX-License-Identifier: Apache-2.0
// The server as a process of its own: life, death, command line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <future>
#include <thread>

#include "absl/strings/str_cat.h"
#include "core/trace/trace_context.h"
#include "planner_client/coverage_client/coverage_client.h"
#include "planner_client/embedded_server/embedded_server.h"
#include "tests/integration/coverage_server/service_fixture.h"
#include "tests/integration/run_process.h"
#include "tests/limits/wait_until.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

std::string Binary() { return BinFolder() + "/fake_coverage_server"; }

class ServerProcessTest : public ::testing::Test {
 protected:
  // Longer than the test may take.
  static constexpr int kEndless_ms = 24 * 3600 * 1000;

  ~ServerProcessTest() override { unsetenv("SIGHTLINE_FAKE_QUERY_FILE"); }
  void Start(int query_ms = 0, int build_ms = 0, std::vector<std::string> arguments = {}) {
    setenv("SIGHTLINE_FAKE_QUERY_FILE", query_file_.c_str(), 1);
    setenv("SIGHTLINE_FAKE_QUERY_MS", absl::StrCat(query_ms).c_str(), 1);
    setenv("SIGHTLINE_FAKE_BUILD_MS", absl::StrCat(build_ms).c_str(), 1);
    EmbeddedServerOptions options;
    options.binary = Binary();
    options.arguments = std::move(arguments);
    // Longer than the test may take: a server that has to be killed fails it.
    options.stop_timeout = absl::Hours(24);
    auto server = EmbeddedServer::Start(options);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
  }

  absl::StatusOr<std::unique_ptr<CoverageClient>> Open() {
    CoverageTask task;
    task.part = LoadedBox({0.1f, 0.2f, 0.3f});
    CoverageClientOptions options;
    options.embedded = server_.get();
    options.max_batch = 64;
    return CoverageClient::Open(options, task);
  }

  const TemporaryFolder folder_;
  const std::string query_file_ = folder_.path() + "/query";  // is there once a query began
  std::unique_ptr<EmbeddedServer> server_;
};

bool Exists(int pid) { return pid > 0 && kill(pid, 0) == 0; }

// kill() takes -1 for "every process" and 0 for "our group": never that.
void SendSignal(pid_t pid, int signal_number) {
  ASSERT_GT(pid, 1);
  ASSERT_EQ(kill(pid, signal_number), 0);
}

// A call that the server complains of: the line names the request that the caller works on.
TEST_F(ServerProcessTest, LogNamesTheRequestOfTheCaller) {
  Start();
  ServerAccess access;
  access.embedded = server_.get();
  const auto stub = v1::CoverageService::NewStub(OpenChannel(access));
  const auto ask_wrongly = [&] {
    grpc::ClientContext context;
    Connection::SetTimeout(&context);
    v1::CreateSceneResponse response;
    return stub->CreateScene(&context, v1::CreateSceneRequest(), &response);
  };
  {
    const ScopedTrace trace("00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01");
    EXPECT_EQ(ask_wrongly().error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  }
  EXPECT_EQ(ask_wrongly().error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  std::ifstream log(server_->folder() + "/stderr.log");
  std::string line;
  ASSERT_TRUE(std::getline(log, line));
  EXPECT_THAT(line, HasSubstr(" trace_id=0af7651916cd43dd8448eb211c80319c event=call"));
  // A call without one gets its own.
  ASSERT_TRUE(std::getline(log, line));
  EXPECT_THAT(line, ::testing::ContainsRegex(" trace_id=[0-9a-f]{32} event=call"));
  EXPECT_THAT(line, ::testing::Not(HasSubstr("0af7651916cd43dd8448eb211c80319c")));
}

// Most memory that a process had so far.
int64_t PeakMemoryBytes(pid_t pid) {
  std::ifstream file(absl::StrCat("/proc/", pid, "/status"));
  std::string word;
  int64_t kib = 0;
  while (file >> word) {
    if (word == "VmHWM:" && file >> kib) break;
  }
  return kib * 1024;
}

// A message of zeros is a thousandth of its size when it is packed.
TEST_F(ServerProcessTest, PackedMessagesAreRefusedAndNotUnpacked) {
  Start();
  Connection connection(server_->address());
  v1::UploadPartRequest zeros;
  zeros.set_chunk(std::string(192 << 20, '\0'));
  v1::CreateSceneRequest large;
  large.set_request_id(zeros.chunk());
  const int64_t before = PeakMemoryBytes(server_->pid());
  ASSERT_GT(before, 0);
  for (const auto algorithm : {GRPC_COMPRESS_GZIP, GRPC_COMPRESS_DEFLATE}) {
    grpc::ClientContext unary;
    Connection::SetTimeout(&unary);
    unary.set_compression_algorithm(algorithm);
    v1::CreateSceneResponse ignored;
    const grpc::Status created = connection.coverage->CreateScene(&unary, large, &ignored);
    EXPECT_EQ(created.error_code(), grpc::StatusCode::UNIMPLEMENTED) << created.error_message();

    grpc::ClientContext stream;
    Connection::SetTimeout(&stream);
    stream.set_compression_algorithm(algorithm);
    v1::UploadPartResponse nothing;
    auto writer = connection.coverage->UploadPart(&stream, &nothing);
    writer->Write(zeros);
    writer->WritesDone();
    const grpc::Status uploaded = writer->Finish();
    EXPECT_EQ(uploaded.error_code(), grpc::StatusCode::UNIMPLEMENTED) << uploaded.error_message();
  }
  EXPECT_LT(PeakMemoryBytes(server_->pid()) - before, int64_t{64} << 20);
  // Small ones neither; as they are, messages are taken.
  grpc::ClientContext small;
  Connection::SetTimeout(&small);
  small.set_compression_algorithm(GRPC_COMPRESS_GZIP);
  v1::ListJobsResponse jobs;
  EXPECT_EQ(connection.jobs->ListJobs(&small, {}, &jobs).error_code(),
            grpc::StatusCode::UNIMPLEMENTED);
  grpc::ClientContext plain;
  Connection::SetTimeout(&plain);
  EXPECT_TRUE(connection.jobs->ListJobs(&plain, {}, &jobs).ok());
}

TEST_F(ServerProcessTest, EmbeddedServerIsPrivateAndCleansUp) {
  Start();
  const std::string socket = server_->address().substr(5);
  const std::filesystem::path folder = std::filesystem::path(socket).parent_path();
  struct stat info {};
  ASSERT_EQ(stat(folder.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0700u);
  const int pid = server_->pid();
  EXPECT_NE(getpgid(pid), getpgid(0));
  EXPECT_TRUE(server_->CheckAlive().ok());
  {
    auto client = Open();
    ASSERT_TRUE(client.ok()) << client.status();
    EXPECT_EQ((*client)->Gains(Measurements(200), std::vector<float>(1000))->size(), 200u);
  }
  server_.reset();
  EXPECT_FALSE(Exists(pid));
  EXPECT_FALSE(std::filesystem::exists(folder));
}

// A client may go at any moment after its last call, also when it is the process's only use of
// gRPC.
TEST_F(ServerProcessTest, ClientsComeAndGo) {
  Start();
  for (int i = 0; i < 40; ++i) {
    auto client = Open();
    ASSERT_TRUE(client.ok()) << client.status();
    ASSERT_TRUE((*client)->Gains(Measurements(200), std::vector<float>(1000)).ok());
  }
}

TEST_F(ServerProcessTest, EmbeddedServerErrorsSayWhy) {
  EmbeddedServerOptions options;
  options.binary = "/nonexistent/coverage_server";
  EXPECT_EQ(EmbeddedServer::Start(options).status().code(), absl::StatusCode::kNotFound);
  options.binary = Binary();
  options.arguments = {"--threads", "many"};
  const absl::Status wrong = EmbeddedServer::Start(options).status();
  EXPECT_EQ(wrong.code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(wrong.message()), HasSubstr("exit code 2"));
  EXPECT_THAT(std::string(wrong.message()), HasSubstr("many"));
  options.arguments.clear();
  options.binary = "/bin/cat";
  EXPECT_EQ(EmbeddedServer::Start(options).status().code(), absl::StatusCode::kUnavailable);
}

TEST_F(ServerProcessTest, KilledServerIsRestartedOnceAndThePlanGoesOn) {
  // Queries of the first server take longer than the test may, those of the second no time.
  Start(/*query_ms=*/kEndless_ms);
  auto client = Open();
  ASSERT_TRUE(client.ok()) << client.status();
  const std::vector<Measurement> measurements = Measurements(400);
  const int first_pid = server_->pid();
  auto during = std::async(
      std::launch::async, [&] { return (*client)->Gains(measurements, std::vector<float>(1000)); });
  WaitUntil([&] { return std::filesystem::exists(query_file_); });
  setenv("SIGHTLINE_FAKE_QUERY_MS", "0", 1);
  SendSignal(first_pid, SIGKILL);
  const auto interrupted = during.get();
  ASSERT_TRUE(interrupted.ok()) << interrupted.status();
  const auto undisturbed = (*client)->Gains(measurements, std::vector<float>(1000));
  ASSERT_TRUE(undisturbed.ok()) << undisturbed.status();
  EXPECT_EQ(NewTargets(*interrupted), NewTargets(*undisturbed));
  EXPECT_NE(server_->pid(), first_pid);
  EXPECT_EQ((*client)->recoveries(), 1);

  // Twice is a fault that the user must know of.
  SendSignal(server_->pid(), SIGKILL);
  const auto again = (*client)->Gains(measurements, std::vector<float>(1000));
  EXPECT_EQ(again.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(again.status().message()), HasSubstr("was killed by signal 9"));
  EXPECT_THAT(std::string(again.status().message()), HasSubstr("restarted once before"));
}

TEST_F(ServerProcessTest, ServerKilledWhileBuildingIsRestarted) {
  Start(0, /*build_ms=*/kEndless_ms);
  const int first_pid = server_->pid();
  auto opened = std::async(std::launch::async, [&] { return Open(); });
  absl::SleepFor(absl::Milliseconds(150));
  setenv("SIGHTLINE_FAKE_BUILD_MS", "0", 1);
  SendSignal(first_pid, SIGKILL);
  auto client = opened.get();
  ASSERT_TRUE(client.ok()) << client.status();
  EXPECT_NE(server_->pid(), first_pid);
  EXPECT_TRUE((*client)->Gains(Measurements(3), std::vector<float>(1000)).ok());
}

TEST_F(ServerProcessTest, ServerDiesWithItsParent) {
  TemporaryFolder folder;
  const std::string binary = Binary();
  const std::string address = "unix:" + folder.path() + "/s";
  int lifeline[2];
  int report[2];
  ASSERT_EQ(pipe(lifeline), 0);
  ASSERT_EQ(pipe(report), 0);
  // Orphans become our children, so that we can see how they end.
  ASSERT_EQ(prctl(PR_SET_CHILD_SUBREAPER, 1), 0);
  const pid_t parent = fork();
  ASSERT_GE(parent, 0);
  if (parent == 0) {
    const pid_t server = fork();
    if (server < 0) _exit(1);
    if (server == 0) {
      close(lifeline[1]);
      dup2(lifeline[0], 100);
      execl(binary.c_str(), binary.c_str(), "--listen", address.c_str(), "--parent-fd", "100",
            "--log-level", "error", nullptr);
      _exit(127);
    }
    [[maybe_unused]] const ssize_t written = write(report[1], &server, sizeof(server));
    pause();
    _exit(0);
  }
  close(lifeline[0]);
  close(lifeline[1]);
  pid_t server = 0;
  ASSERT_EQ(read(report[0], &server, sizeof(server)), static_cast<ssize_t>(sizeof(server)));
  close(report[0]);
  close(report[1]);
  Connection connection(address);
  ASSERT_TRUE(connection.channel->WaitForConnected(FarDeadline()));
  EXPECT_EQ(waitpid(server, nullptr, WNOHANG), -1);  // not ours yet
  SendSignal(parent, SIGKILL);
  waitpid(parent, nullptr, 0);
  // Now it is; it ends by itself.
  int status = 0;
  EXPECT_EQ(waitpid(server, &status, 0), server);
  EXPECT_TRUE(WIFEXITED(status));
  prctl(PR_SET_CHILD_SUBREAPER, 0);
}

TEST_F(ServerProcessTest, SigtermFinishesWhatIsRunning) {
  Start(/*query_ms=*/300);
  auto client = Open();
  ASSERT_TRUE(client.ok()) << client.status();
  Connection connection(server_->address());
  auto running = std::async(std::launch::async, [&] {
    v1::EvaluateGainsResponse response;
    return connection.Gains(GainsRequest((*client)->scene().scene_digest, 1), &response);
  });
  WaitUntil([&] { return std::filesystem::exists(query_file_); });
  SendSignal(server_->pid(), SIGTERM);
  const absl::Status status = running.get();
  EXPECT_TRUE(status.ok()) << status;
  WaitUntil([&] { return !server_->CheckAlive().ok(); });
  EXPECT_THAT(std::string(server_->CheckAlive().message()), HasSubstr("exit code 0"));
}

// The call would take longer than the test may, and the server would let it.
TEST_F(ServerProcessTest, SecondSignalEndsAtOnce) {
  Start(/*query_ms=*/kEndless_ms, 0, {"--drain-seconds", "3600"});
  auto client = Open();
  ASSERT_TRUE(client.ok()) << client.status();
  Connection connection(server_->address());
  auto running = std::async(std::launch::async, [&] {
    v1::EvaluateGainsResponse response;
    return connection.Gains(GainsRequest((*client)->scene().scene_digest, 1), &response);
  });
  WaitUntil([&] { return std::filesystem::exists(query_file_); });
  SendSignal(server_->pid(), SIGINT);
  absl::SleepFor(absl::Milliseconds(100));
  EXPECT_TRUE(server_->CheckAlive().ok());
  SendSignal(server_->pid(), SIGINT);
  EXPECT_EQ(running.get().code(), absl::StatusCode::kUnavailable);
}

TEST_F(ServerProcessTest, ClientFindsARestartedServerByItself) {
  setenv("SIGHTLINE_FAKE_QUERY_MS", "0", 1);
  setenv("SIGHTLINE_FAKE_BUILD_MS", "0", 1);
  Start();
  CoverageTask task;
  task.part = LoadedBox({0.1f, 0.2f, 0.3f});
  CoverageClientOptions options;
  options.address = server_->address();  // as if it were somebody else's
  options.retry_for = absl::Hours(24);
  auto client = CoverageClient::Open(options, task);
  ASSERT_TRUE(client.ok()) << client.status();
  const auto before = (*client)->Gains(Measurements(100), std::vector<float>(1000));
  SendSignal(server_->pid(), SIGKILL);
  auto during = std::async(std::launch::async, [&] {
    return (*client)->Gains(Measurements(100), std::vector<float>(1000));
  });
  absl::SleepFor(absl::Milliseconds(300));
  WaitUntil([&] { return !server_->CheckAlive().ok(); });
  ASSERT_TRUE(server_->Restart().ok());
  const auto after = during.get();
  ASSERT_TRUE(before.ok() && after.ok()) << before.status() << after.status();
  EXPECT_EQ(NewTargets(*after), NewTargets(*before));
}

TEST_F(ServerProcessTest, CommandLine) {
  const ProcessResult help = RunProcess(Binary() + " --help");
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_THAT(help.output, HasSubstr("--max-part-bytes"));
  EXPECT_EQ(RunProcess(Binary()).exit_code, 2);
  EXPECT_EQ(RunProcess(Binary() + " --listen nonsense").exit_code, 2);
  EXPECT_EQ(RunProcess(Binary() + " --listen 127.0.0.1:0 --no-such-flag").exit_code, 2);
  const ProcessResult tls = RunProcess(
      Binary() + " --listen 127.0.0.1:0 --tls-cert /nonexistent.pem --tls-key /dev/null");
  EXPECT_EQ(tls.exit_code, 2);
  EXPECT_THAT(tls.output, HasSubstr("/nonexistent.pem"));
  EXPECT_EQ(RunProcess(Binary() + " --listen unix:/nonexistent/folder/s").exit_code, 1);
  const ProcessResult plain = RunProcess(Binary() + " --listen 0.0.0.0:0");
  EXPECT_EQ(plain.exit_code, 2);
  EXPECT_THAT(plain.output, HasSubstr("--allow-plaintext"));
  const ProcessResult metrics =
      RunProcess(Binary() + " --listen 127.0.0.1:0 --metrics-host 0.0.0.0 --metrics-port 1");
  EXPECT_EQ(metrics.exit_code, 2);
  EXPECT_THAT(metrics.output, HasSubstr("--metrics-host 0.0.0.0"));
}

}  // namespace
}  // namespace sightline
