// SPDX-License-Identifier: Apache-2.0
// Clients that want too much, or nothing at all, do no harm to the others.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "rpc_server/health_check.h"
#include "rpc_server/peer_turns.h"
#include "rpc_server/upload.h"
#include "tests/integration/coverage_server/fake_scene.h"
#include "tests/integration/coverage_server/service_fixture.h"
#include "tests/limits/wait_until.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

using GainStream = grpc::ClientReaderWriter<v1::StreamGainsRequest, v1::StreamGainsResponse>;

// A stream of gains that is open and may say nothing.
struct OpenStream {
  grpc::ClientContext context;
  std::unique_ptr<GainStream> stream;

  // Waits for its end.
  absl::Status Finish() {
    v1::StreamGainsResponse ignored;
    while (stream->Read(&ignored)) {
    }
    return FromGrpcStatus(stream->Finish());
  }
};

class ServerLimitsTest : public ::testing::Test {
 protected:
  void Start(CoverageServerOptions options, FakeOptions fake = {}) {
    StartWith(std::move(options), MakeFakeBackend(fake));
  }
  void StartWith(CoverageServerOptions options, CoverageBackend backend) {
    options.listen = "127.0.0.1:0";
    options.threads = 2;
    auto server = CoverageServer::Start(options, std::move(backend));
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    connection_ = std::make_unique<Connection>(server_->address());
  }

  // Health of the coverage service, or of the server as a whole.
  bool Serves(const std::string& service = "sightline.v1.CoverageService") {
    HealthCheckOptions check;
    check.address = server_->address();
    check.service = service;
    check.timeout = absl::Hours(24);
    return CheckHealth(check).ok();
  }

  std::unique_ptr<OpenStream> OpenGainStream(Connection& connection) {
    auto open = std::make_unique<OpenStream>();
    Connection::SetTimeout(&open->context);
    open->stream = connection.coverage->StreamGains(&open->context);
    return open;
  }

  std::unique_ptr<CoverageServer> server_;
  std::unique_ptr<Connection> connection_;
};

// An upload whose header has been sent.
struct OpenUpload {
  grpc::ClientContext context;
  v1::UploadPartResponse response;
  std::unique_ptr<grpc::ClientWriter<v1::UploadPartRequest>> writer;

  OpenUpload(Connection& connection, int64_t size_bytes) {
    Connection::SetTimeout(&context);
    writer = connection.coverage->UploadPart(&context, &response);
    v1::UploadPartRequest message;
    message.mutable_header()->set_format("ply");
    message.mutable_header()->set_unit("m");
    message.mutable_header()->set_size_bytes(size_bytes);
    EXPECT_TRUE(writer->Write(message));
  }
  bool Send(const std::string& bytes) {
    v1::UploadPartRequest message;
    message.set_chunk(bytes);
    return writer->Write(message);
  }
};

TEST_F(ServerLimitsTest, UploadsThatAreOnlyAnnouncedHoldUpNobody) {
  CoverageServerOptions options;
  options.idle_timeout = absl::Hours(24);
  Start(options);
  std::vector<std::unique_ptr<OpenUpload>> idle;
  for (int i = 0; i < 8; ++i) {
    idle.push_back(std::make_unique<OpenUpload>(*connection_, options.max_part_file_bytes));
  }
  for (int i = 0; i < 5; ++i) {
    v1::UploadPartResponse uploaded;
    const absl::Status status =
        connection_->Upload(EncodePly(MakeBox({0.1f, 0.1f, 0.1f})), "ply", "m", &uploaded);
    EXPECT_TRUE(status.ok()) << status;
  }
  for (auto& upload : idle) upload->context.TryCancel();
}

TEST_F(ServerLimitsTest, UploadsThatStopOrCrawlAreEnded) {
  CoverageServerOptions options;
  options.idle_timeout = absl::Milliseconds(400);
  Start(options);
  OpenUpload stopped(*connection_, 1 << 20);
  const absl::Status idle = FromGrpcStatus(stopped.writer->Finish());
  EXPECT_EQ(idle.code(), absl::StatusCode::kDeadlineExceeded) << idle;
  EXPECT_THAT(std::string(idle.message()), HasSubstr("no message came within 400ms"));

  // A byte now and then is no better. On a busy machine this client may pause for too long: the
  // server then sees an upload that has stopped, and the client tries again.
  absl::Status slow;
  absl::Duration longest_pause;
  do {
    OpenUpload crawling(*connection_, 1 << 20);
    longest_pause = absl::ZeroDuration();
    bool open = true;
    while (open) {
      const absl::Time before = absl::Now();
      absl::SleepFor(absl::Milliseconds(50));
      open = crawling.Send("x");
      longest_pause = std::max(longest_pause, absl::Now() - before);
    }
    slow = FromGrpcStatus(crawling.writer->Finish());
    EXPECT_EQ(slow.code(), absl::StatusCode::kDeadlineExceeded) << slow;
  } while (longest_pause > options.idle_timeout / 2);
  EXPECT_THAT(std::string(slow.message()), HasSubstr("slower than 100000 bytes/s"));

  // And one that never says what it is.
  grpc::ClientContext context;
  Connection::SetTimeout(&context);
  v1::UploadPartResponse response;
  auto mute = connection_->coverage->UploadPart(&context, &response);
  EXPECT_EQ(FromGrpcStatus(mute->Finish()).code(), absl::StatusCode::kDeadlineExceeded);
}

TEST(UploadTest, SaysWhoseMemoryIsUsedUp) {
  const SharedLimit memory(100, 60);
  SharedLimit::Share first = memory.Of("a"), second = memory.Of("b");
  EXPECT_TRUE(GrowUpload(&first, "a", 60).ok());
  const absl::Status own = GrowUpload(&first, "a", 1);
  EXPECT_EQ(own.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(ErrorReason(own), "OVERLOADED");
  EXPECT_TRUE(RetryDelay(own).has_value());
  EXPECT_THAT(std::string(own.message()), HasSubstr("a is uploading 60 bytes"));
  EXPECT_TRUE(GrowUpload(&second, "b", 40).ok());
  const absl::Status of_all = GrowUpload(&second, "b", 1);
  EXPECT_EQ(of_all.code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(of_all.message()), HasSubstr("clients are uploading 100 bytes"));
}

TEST(PeerTurnsTest, APeerHasOneAtATimeAndTheOthersWait) {
  PeerTurns turns(2);
  const auto go_on = [] { return absl::OkStatus(); };
  const auto stop = [] { return absl::CancelledError("stop"); };
  auto first = turns.Wait("a", stop);
  ASSERT_TRUE(first.ok());  // a free turn does not ask
  EXPECT_TRUE(absl::IsCancelled(turns.Wait("a", stop).status()));
  {
    auto other = turns.Wait("b", go_on);
    ASSERT_TRUE(other.ok());
    EXPECT_TRUE(absl::IsCancelled(turns.Wait("c", stop).status()));
  }
  EXPECT_TRUE(turns.Wait("c", go_on).ok());
  // A waiting caller is woken, and nobody has the turn of a peer while it has it.
  std::atomic<int> at_work{0}, most{0};
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&] {
      for (int k = 0; k < 100; ++k) {
        auto turn = turns.Wait("b", go_on);
        most = std::max(most.load(), ++at_work);
        --at_work;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(most, 1);
}

TEST_F(ServerLimitsTest, IdleStreamsOfOnePeerLeaveRoomForTheOthers) {
  CoverageServerOptions options;
  std::string scene;
  std::vector<std::unique_ptr<Connection>> connections;
  std::vector<std::unique_ptr<OpenStream>> streams;
  // All streams and calls must fit into the time for which the first stream may be idle: a busy
  // machine gets more.
  absl::Duration needed;
  options.idle_timeout = absl::Milliseconds(1500);
  do {
    options.idle_timeout *= 2;
    for (auto& stream : streams) stream->context.TryCancel();
    for (auto& stream : streams) stream->Finish().IgnoreError();
    streams.clear();
    connections.clear();
    Start(options);
    scene = connection_->MakeScene();
    const absl::Time start = absl::Now();
    for (int i = 0; i < 300; ++i) {
      if (i % 60 == 0) connections.push_back(std::make_unique<Connection>(server_->address()));
      streams.push_back(OpenGainStream(*connections.back()));
    }
    for (int i = 0; i < 20; ++i) {
      v1::EvaluateGainsResponse response;
      const absl::Status status = connection_->Gains(GainsRequest(scene, 10), &response);
      EXPECT_TRUE(status.ok()) << status;
    }
    needed = absl::Now() - start;
  } while (needed > options.idle_timeout / 2);
  EXPECT_TRUE(Serves(""));
  EXPECT_TRUE(Serves()) << "a single peer cannot saturate the server";
  int refused = 0, idle = 0;
  for (auto& stream : streams) {
    const absl::Status status = stream->Finish();
    if (absl::IsResourceExhausted(status)) {
      ++refused;
      EXPECT_EQ(ErrorReason(status), "PEER_QUOTA_EXCEEDED") << status;
    } else {
      ++idle;
      EXPECT_TRUE(absl::IsDeadlineExceeded(status)) << status;
    }
  }
  // A half of the calls may be streams, and a half of those of one peer.
  EXPECT_EQ(idle, options.max_call_threads / 4);
  EXPECT_EQ(refused, 300 - idle);
  // They are gone: a new one works.
  auto stream = OpenGainStream(*connection_);
  v1::StreamGainsRequest request;
  *request.mutable_request() = GainsRequest(scene, 3);
  ASSERT_TRUE(stream->stream->Write(request));
  v1::StreamGainsResponse response;
  ASSERT_TRUE(stream->stream->Read(&response));
  EXPECT_EQ(response.response().gains_size(), 3);
  stream->stream->WritesDone();
  EXPECT_TRUE(stream->Finish().ok());
}

TEST_F(ServerLimitsTest, HealthOfTheServiceShowsThatItIsSaturated) {
  CoverageServerOptions options;
  options.max_call_threads = 8;
  options.peer_share = 1;
  options.idle_timeout = absl::Hours(24);
  Start(options);
  EXPECT_TRUE(Serves());
  std::vector<std::unique_ptr<OpenStream>> streams;
  for (int i = 0; i < 4; ++i) streams.push_back(OpenGainStream(*connection_));
  WaitUntil([&] { return !Serves(); });
  EXPECT_TRUE(Serves("")) << "it is alive";
  // One more stream is refused, and may be tried again; other calls are served.
  const absl::Status refused = OpenGainStream(*connection_)->Finish();
  EXPECT_EQ(refused.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(ErrorReason(refused), "OVERLOADED");
  EXPECT_TRUE(RetryDelay(refused).has_value());
  v1::EvaluateGainsResponse response;
  EXPECT_TRUE(absl::IsNotFound(connection_->Gains(GainsRequest("unknown", 1), &response)));
  streams.pop_back();
  WaitUntil([&] { return Serves(); });
}

TEST_F(ServerLimitsTest, AClientThatTakesNothingIsLeft) {
  CoverageServerOptions options;
  options.idle_timeout = absl::Milliseconds(500);
  FakeOptions fake;
  fake.targets = 1000000;  // 28 MB to be sent
  Start(options, fake);
  const std::string scene = connection_->MakeScene();
  Connection lazy(server_->address());
  grpc::ClientContext context;
  Connection::SetTimeout(&context);
  v1::StreamTargetsRequest request;
  request.set_scene_digest(scene);
  auto reader = lazy.coverage->StreamTargets(&context, request);
  absl::SleepFor(absl::Seconds(2));
  v1::StreamTargetsResponse response;
  int64_t got = 0;
  while (reader->Read(&response)) got += response.regions_size();
  const absl::Status status = FromGrpcStatus(reader->Finish());
  EXPECT_EQ(status.code(), absl::StatusCode::kDeadlineExceeded) << status;
  EXPECT_LT(got, 1000000);
  // One that reads gets all, unless a busy machine holds it up.
  WaitUntil([&] {
    grpc::ClientContext again;
    Connection::SetTimeout(&again);
    reader = connection_->coverage->StreamTargets(&again, request);
    got = 0;
    while (reader->Read(&response)) got += response.regions_size();
    const absl::Status all = FromGrpcStatus(reader->Finish());
    EXPECT_TRUE(all.ok() || absl::IsDeadlineExceeded(all)) << all;
    return all.ok();
  });
  EXPECT_EQ(got, 1000000);
}

// Memory that runs out, in a call, on the pool, and in a job.
TEST_F(ServerLimitsTest, LackOfMemoryIsAnErrorOfTheCall) {
  CoverageBackend backend = MakeFakeBackend({});
  auto build = backend.build_scene;
  auto failing = std::make_shared<std::atomic<bool>>(true);
  backend.build_scene = [build, failing](SceneDefinition definition,
                                         const SceneBuildOptions& options) {
    if (*failing) throw std::bad_alloc();
    return build(std::move(definition), options);
  };
  backend.render_view = [](const CoverageScene&,
                           const ViewRequest&) -> absl::StatusOr<std::string> {
    throw std::bad_alloc();
  };
  StartWith({}, std::move(backend));
  const v1::SceneSpec spec = connection_->UploadBox();
  const auto job = connection_->CreateScene(spec);
  ASSERT_TRUE(job.ok()) << job.status();
  const auto states = connection_->Watch(job->job_id());
  ASSERT_TRUE(states.ok()) << states.status();
  EXPECT_EQ(states->back().state(), v1::Job::STATE_FAILED);
  EXPECT_EQ(states->back().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(states->back().error_message(), "out of memory");
  // The same request succeeds when there is memory again.
  *failing = false;
  const std::string scene = connection_->MakeScene(spec);
  EXPECT_FALSE(scene.empty());

  grpc::ClientContext context;
  Connection::SetTimeout(&context);
  v1::RenderViewRequest view;
  view.set_scene_digest(scene);
  view.set_view(v1::RenderViewRequest::VIEW_FREE);
  v1::RenderViewResponse picture;
  const absl::Status status =
      FromGrpcStatus(connection_->coverage->RenderView(&context, view, &picture));
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
}

// A client that is only a socket.
class RawClient {
 public:
  RawClient(const std::string& address, const std::string& bytes)
      : fd_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    to.sin_port = htons(static_cast<uint16_t>(std::stoi(address.substr(address.rfind(':') + 1))));
    EXPECT_EQ(connect(fd_, reinterpret_cast<sockaddr*>(&to), sizeof(to)), 0);
    EXPECT_EQ(send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(bytes.size()));
  }
  ~RawClient() { close(fd_); }
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  // Waits until the server closes the connection; what it sends before is thrown away.
  void WaitUntilClosed() {
    char buffer[4096];
    while (recv(fd_, buffer, sizeof(buffer), 0) > 0) {
    }
  }

 private:
  int fd_;
};

TEST_F(ServerLimitsTest, ConnectionsThatDoNotBecomeHttp2AreClosed) {
  Start({});
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 50; ++i) {
    // Nothing at all; half of the preface; all of it without the SETTINGS that must follow.
    const char* const beginnings[] = {"", "PRI * HTTP/2.0\r\n", "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"};
    clients.push_back(std::make_unique<RawClient>(server_->address(), beginnings[i % 3]));
  }
  for (auto& client : clients) client->WaitUntilClosed();
  EXPECT_TRUE(Serves());
}

}  // namespace
}  // namespace sightline
