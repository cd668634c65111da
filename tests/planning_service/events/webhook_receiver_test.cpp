// SPDX-License-Identifier: Apache-2.0
// Webhooks against a real HTTP server.
#include "planning_service/events/webhook_receiver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <httplib.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>

#include "stored_events.h"
#include "tests/integration/test_certificates.h"
#include "tests/limits/wait_until.h"

namespace sightline {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr char kSecret[] = "the secret between plant and service";

struct Post {
  std::string body;
  std::string event, delivery, signature, content_type;
};

// Remembers what is posted to it, and gives scripted answers.
class Peer {
 public:
  explicit Peer(std::unique_ptr<httplib::Server> server = std::make_unique<httplib::Server>(),
                int port = 0)
      : server_(std::move(server)) {
    server_->Post("/hook", [this](const httplib::Request& request, httplib::Response& response) {
      std::lock_guard lock(mutex_);
      ++attempts_;
      response.status = answer_;
      if (answer_ == 302) response.set_header("Location", "/elsewhere");
      if (answer_ / 100 != 2) return;
      posts_.push_back({request.body, request.get_header_value("X-Sightline-Event"),
                        request.get_header_value("X-Sightline-Delivery"),
                        request.get_header_value("X-Sightline-Signature"),
                        request.get_header_value("Content-Type")});
    });
    server_->Post("/elsewhere", [this](const httplib::Request&, httplib::Response&) {
      std::lock_guard lock(mutex_);
      ++redirected_;
    });
    if (port == 0) {
      port_ = server_->bind_to_any_port("127.0.0.1");
    } else {
      EXPECT_TRUE(server_->bind_to_port("127.0.0.1", port));
      port_ = port;
    }
    EXPECT_GT(port_, 0);
    thread_ = std::thread([this] { server_->listen_after_bind(); });
  }
  ~Peer() {
    // A stop before the start would be lost.
    WaitUntil([this] { return server_->is_running(); });
    server_->stop();
    thread_.join();
  }

  int port() const { return port_; }
  std::string url() const { return absl::StrCat("http://127.0.0.1:", port_, "/hook"); }
  void Answer(int code) {
    std::lock_guard lock(mutex_);
    answer_ = code;
  }
  std::vector<Post> posts() {
    std::lock_guard lock(mutex_);
    return posts_;
  }
  std::vector<std::string> deliveries() {
    std::vector<std::string> ids;
    for (const Post& post : posts()) ids.push_back(post.delivery);
    return ids;
  }
  int attempts() {
    std::lock_guard lock(mutex_);
    return attempts_;
  }
  int redirected() {
    std::lock_guard lock(mutex_);
    return redirected_;
  }

 private:
  std::unique_ptr<httplib::Server> server_;
  int port_ = 0;
  std::thread thread_;
  std::mutex mutex_;
  std::vector<Post> posts_;
  int answer_ = 200;
  int attempts_ = 0;
  int redirected_ = 0;
};

class WebhookReceiverTest : public ::testing::Test {
 protected:
  std::unique_ptr<EventReceiver> Webhook(const std::string& url, const std::string& ca_file = "") {
    WebhookOptions options;
    options.url = url;
    options.secret_file = secret_file_;
    options.ca_file = ca_file;
    options.timeout = absl::Seconds(30);  // the longest that is allowed
    auto receiver = MakeWebhookReceiver(options);
    EXPECT_TRUE(receiver.ok()) << receiver.status();
    return receiver.ok() ? *std::move(receiver) : nullptr;
  }

  // HMAC by another implementation than ours.
  std::string SignatureByPython(const std::string& body) {
    const std::string file = folder_.Write("body", body);
    const std::string command =
        absl::StrCat("python3 -c \"import hmac;print(hmac.new(b'", kSecret, "',open('", file,
                     "','rb').read(),'sha256').hexdigest(),end='')\"");
    FILE* pipe = popen(command.c_str(), "r");
    EXPECT_NE(pipe, nullptr);
    char text[200] = "";
    const size_t size = fread(text, 1, sizeof(text), pipe);
    EXPECT_EQ(pclose(pipe), 0);
    return std::string(text, size);
  }

  TestFolder folder_;
  const std::string secret_file_ = folder_.Write("secret", std::string(kSecret) + "\n");
  StoredEvents events_{folder_};
};

TEST_F(WebhookReceiverTest, PostsSignedEventsInOrder) {
  Peer peer;
  const std::string first = events_.AddJob();
  const std::string second = events_.AddJob();
  EventDelivery delivery(events_.store(), Receivers(Webhook(peer.url())), QuickRetries());
  EXPECT_EQ(events_.FinishJob(), first);
  WaitUntil([&] { return peer.posts().size() >= events_.All().size(); });
  delivery.Stop();
  EXPECT_EQ(peer.deliveries(), events_.AllIds());

  const std::vector<JobEvent> stored = events_.All();
  const std::vector<Post> posts = peer.posts();
  ASSERT_EQ(posts.size(), stored.size());
  for (size_t i = 0; i < posts.size(); ++i) {
    const Post& post = posts[i];
    EXPECT_EQ(post.content_type, "application/json");
    EXPECT_EQ(post.signature, "sha256=" + SignatureByPython(post.body));
    const nlohmann::json event = nlohmann::json::parse(post.body);
    EXPECT_EQ(event["event_id"], post.delivery);
    EXPECT_EQ(event["type"], post.event);
    EXPECT_EQ(event["type"], stored[i].type);
    EXPECT_EQ(event["job"]["job_id"], stored[i].job.job_id);
    EXPECT_EQ(event["job"]["kind"], "plan");
    EXPECT_EQ(event["job"]["client"], "mes");
    EXPECT_TRUE(event["job"].contains("progress"));
    absl::Time time;
    std::string error;
    EXPECT_TRUE(
        absl::ParseTime(absl::RFC3339_full, event["time"].get<std::string>(), &time, &error))
        << error;
    EXPECT_LT(absl::AbsDuration(time - stored[i].time), absl::Microseconds(1));
  }
  EXPECT_EQ(posts[0].event, "accepted");
  const nlohmann::json done = nlohmann::json::parse(posts.back().body);
  EXPECT_EQ(done["type"], "done");
  EXPECT_EQ(done["job"]["job_id"], first);
  EXPECT_EQ(done["job"]["state"], "SUCCEEDED");
  EXPECT_EQ(done["job"]["results"][0]["name"], "plan.json");
  // Not just any signature is right.
  EXPECT_NE(posts[0].signature, posts[1].signature);
}

TEST_F(WebhookReceiverTest, PeerMayBeAwayOrRefuse) {
  int port = 0;
  {
    Peer peer;
    port = peer.port();
  }
  for (int i = 0; i < 3; ++i) events_.AddJob();
  const std::string url = absl::StrCat("http://127.0.0.1:", port, "/hook");
  EventDelivery delivery(events_.store(), Receivers(Webhook(url)), QuickRetries());
  WaitUntil([&] { return delivery.receivers()[0].is_failing; });
  Peer peer(std::make_unique<httplib::Server>(), port);
  WaitUntil([&] { return peer.posts().size() == 3; });
  for (const int code : {500, 404, 302, 429}) {
    peer.Answer(code);
    const int before = peer.attempts();
    const size_t got = peer.posts().size();
    events_.AddJob();
    WaitUntil([&] { return peer.attempts() >= before + 2; });
    EXPECT_EQ(peer.posts().size(), got);
    peer.Answer(204);
    WaitUntil([&] { return peer.posts().size() > got; });
  }
  EXPECT_EQ(WithoutRepetitions(peer.deliveries()), events_.AllIds());
  EXPECT_EQ(peer.redirected(), 0);
}

TEST_F(WebhookReceiverTest, GoneEndsTheReceiver) {
  Peer peer;
  peer.Answer(410);
  events_.AddJob();
  EventDelivery delivery(events_.store(), Receivers(Webhook(peer.url())), QuickRetries());
  WaitUntil([&] { return delivery.receivers()[0].has_ended; });
  peer.Answer(200);
  events_.AddJob();
  absl::SleepFor(absl::Milliseconds(300));
  EXPECT_EQ(peer.attempts(), 1);
}

TEST_F(WebhookReceiverTest, GoesOnWhereItWasAfterARestart) {
  Peer peer;
  events_.AddJob();
  events_.AddJob();
  {
    EventDelivery delivery(events_.store(), Receivers(Webhook(peer.url())), QuickRetries());
    WaitUntil([&] { return delivery.receivers()[0].delivered_events == 2; });
  }
  events_.AddJob();  // while nobody delivers
  events_.Reopen();
  EventDelivery delivery(events_.store(), Receivers(Webhook(peer.url())), QuickRetries());
  events_.AddJob();
  WaitUntil([&] { return peer.posts().size() >= 4; });
  delivery.Stop();
  EXPECT_EQ(WithoutRepetitions(peer.deliveries()), events_.AllIds());
}

TEST_F(WebhookReceiverTest, SecretCanBeChanged) {
  Peer peer;
  events_.AddJob();
  EventDelivery delivery(events_.store(), Receivers(Webhook(peer.url())), QuickRetries());
  WaitUntil([&] { return peer.posts().size() == 1; });
  folder_.Write("secret", "another secret of the plant");
  events_.AddJob();
  WaitUntil([&] { return peer.posts().size() == 2; });
  const std::vector<Post> posts = peer.posts();
  EXPECT_EQ(posts[0].signature, "sha256=" + SignatureByPython(posts[0].body));
  EXPECT_NE(posts[1].signature, "sha256=" + SignatureByPython(posts[1].body));
}

TEST_F(WebhookReceiverTest, ChecksTheCertificate) {
  const TestAuthority authority("plant");
  const PemPair pair = authority.Issue("localhost");
  const std::string certificate = folder_.Write("server.pem", pair.certificate);
  const std::string key = folder_.Write("server.key", pair.key);
  const std::string ca = folder_.Write("ca.pem", authority.certificate());
  const std::string other_ca = folder_.Write("other.pem", TestAuthority("other").certificate());
  Peer peer(std::make_unique<httplib::SSLServer>(certificate.c_str(), key.c_str()));
  events_.AddJob();
  const std::string url = absl::StrCat("https://localhost:", peer.port(), "/hook");
  {
    EventDelivery delivery(events_.store(), Receivers(Webhook(url, other_ca)), QuickRetries());
    WaitUntil([&] { return delivery.receivers()[0].is_failing; });
    EXPECT_EQ(peer.attempts(), 0);
  }
  EventDelivery delivery(events_.store(), Receivers(Webhook(url, ca)), QuickRetries());
  WaitUntil([&] { return peer.posts().size() == 1; });
}

TEST_F(WebhookReceiverTest, PeerThatNeverAnswersDoesNotHoldUpTheEnd) {
  // Takes connections, and that is all.
  const int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  ASSERT_EQ(bind(listener, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  ASSERT_EQ(listen(listener, 10), 0);
  socklen_t size = sizeof(address);
  ASSERT_EQ(getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size), 0);
  events_.AddJob();
  EventDelivery delivery(
      events_.store(),
      Receivers(Webhook(absl::StrCat("http://127.0.0.1:", ntohs(address.sin_port), "/hook"))));
  const int connection = accept(listener, nullptr, nullptr);  // it is in the middle of it now
  ASSERT_GE(connection, 0);
  delivery.Stop();
  EXPECT_EQ(delivery.receivers()[0].delivered_events, 0);
  close(connection);
  close(listener);
}

}  // namespace
}  // namespace sightline
