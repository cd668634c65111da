// SPDX-License-Identifier: Apache-2.0
// Limits on connections by peer, and on how long they may be silent.
#include "planning_service/http/http_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/time/clock.h"
#include "planning_service/http/http_reply.h"
#include "tests/limits/wait_until.h"
#include "tests/planning_service/http_api/raw_connection.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

constexpr char kGet[] = "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n";
constexpr char kGetAndClose[] = "GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";

class HttpServerTest : public ::testing::Test {
 protected:
  HttpServerTest() {
    options_.listen = "127.0.0.1:0";
    options_.max_request_bytes = 1000;
    // Silent connections stay unless a test wants otherwise.
    options_.first_request_timeout = options_.request_timeout = absl::Hours(24);
  }

  void Start() {
    auto server = HttpServer::Listen(options_);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    const std::string& address = server_->listening().address;
    ASSERT_TRUE(absl::SimpleAtoi(address.substr(address.rfind(':') + 1), &port_));
    server_->Start(
        [](HttpExchange& exchange) { ReplyText(exchange, 200, {}, "text/plain", "well\n"); });
  }
  // The answer to one request over a connection of its own.
  std::string Ask(const char* from) const {
    RawConnection connection(port_, from);
    EXPECT_TRUE(connection.connected()) << from;
    connection.Send(kGetAndClose);
    return connection.ReadAll();
  }
  std::unique_ptr<RawConnection> OpenSilent(const char* from) const {
    auto connection = std::make_unique<RawConnection>(port_, from);
    EXPECT_TRUE(connection->connected()) << from;
    return connection;
  }

  HttpServerOptions options_;
  std::unique_ptr<HttpServer> server_;
  int port_ = 0;
};

TEST_F(HttpServerTest, SilentConnectionsOfOnePeerLeaveRoomForTheOthers) {
  options_.max_connections = 8;
  Start();
  std::vector<std::unique_ptr<RawConnection>> silent;
  for (int i = 0; i < 30; ++i) silent.push_back(OpenSilent("127.0.0.2"));
  for (int i = 0; i < 5; ++i) EXPECT_THAT(Ask("127.0.0.1"), StartsWith("HTTP/1.1 200"));
}

TEST_F(HttpServerTest, AllPeersTogetherHaveTwiceAsManyAsOne) {
  options_.max_connections = 1;
  Start();
  const auto first = OpenSilent("127.0.0.2");
  const auto second = OpenSilent("127.0.0.3");
  EXPECT_THAT(Ask("127.0.0.4"), AllOf(StartsWith("HTTP/1.1 503"), HasSubstr("TOO_MANY_CONNECTIONS"),
                                      HasSubstr("as many connections as it takes")));
}

TEST_F(HttpServerTest, APeerIsToldThatItHasTooMany) {
  options_.max_connections = 2;
  Start();
  const auto first = OpenSilent("127.0.0.2");
  auto second = OpenSilent("127.0.0.2");
  EXPECT_THAT(Ask("127.0.0.2"), AllOf(StartsWith("HTTP/1.1 503"), HasSubstr("TOO_MANY_CONNECTIONS"),
                                      HasSubstr("127.0.0.2 has 2 connections already")));
  // A closed connection makes room for a new one.
  second.reset();
  WaitUntil([&] { return absl::StartsWith(Ask("127.0.0.2"), "HTTP/1.1 200"); });
}

TEST_F(HttpServerTest, ConnectionsWithoutARequestAreClosedSoon) {
  options_.max_connections = 1;
  options_.first_request_timeout = absl::Milliseconds(200);
  Start();
  EXPECT_THAT(OpenSilent("127.0.0.1")->ReadAll(), IsEmpty());
  // One that has been answered may be silent for longer. On a busy machine the first request may
  // come too late: once more then.
  std::unique_ptr<RawConnection> known;
  WaitUntil([&] {
    known.reset();
    known = std::make_unique<RawConnection>(port_, "127.0.0.2");
    return known->Send(kGet) && absl::StartsWith(known->ReadUntil("well\n"), "HTTP/1.1 200");
  });
  absl::SleepFor(absl::Milliseconds(1000));
  ASSERT_TRUE(known->Send(kGet));
  EXPECT_THAT(known->ReadUntil("well\n"), StartsWith("HTTP/1.1 200"));
}

}  // namespace
}  // namespace sightline
