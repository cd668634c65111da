// SPDX-License-Identifier: Apache-2.0
// MQTT against a real broker, with a listener of another make.
#include "planning_service/events/mqtt_receiver.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "planning_service/events/webhook_receiver.h"
#include "stored_events.h"
#include "tests/integration/test_certificates.h"
#include "tests/limits/wait_until.h"

namespace sightline {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

int FreePort() {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  socklen_t size = sizeof(address);
  EXPECT_EQ(getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size), 0);
  close(fd);
  return ntohs(address.sin_port);
}

bool CanConnect(int port) {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const bool connected = connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0;
  close(fd);
  return connected;
}

// A program that ends with this object, or with the test however that ends.
class Program {
 public:
  Program(std::vector<std::string> arguments, const std::string& output, int end_signal)
      : end_signal_(end_signal) {
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    pid_ = fork();
    if (pid_ == 0) {
      prctl(PR_SET_PDEATHSIG, SIGKILL);
      const int fd = open(output.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
      dup2(fd, 1);
      dup2(fd, 2);
      execv(argv[0], argv.data());
      _exit(127);
    }
    EXPECT_GT(pid_, 1);
  }
  ~Program() {
    if (pid_ <= 1) return;
    kill(pid_, end_signal_);
    EXPECT_EQ(waitpid(pid_, nullptr, 0), pid_);
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

 private:
  const int end_signal_;
  pid_t pid_ = 0;
};

class Broker {
 public:
  Broker(const TestFolder& folder, const std::string& further = "allow_anonymous true\n")
      : folder_(folder) {
    // Keeps what it has for its listener over a restart, as brokers in plants do.
    config_ = folder.Write(
        "mosquitto.conf",
        absl::StrCat("listener ", port_, " 127.0.0.1\npersistence true\npersistence_location ",
                     folder.path(), "/\nlog_dest stderr\nuser root\n", further));
    Start();
  }
  void Start() {
    program_ = std::make_unique<Program>(std::vector<std::string>{MOSQUITTO, "-c", config_},
                                         folder_.path() + "/mosquitto.log",
                                         SIGTERM);  // it saves what it has then
    WaitUntil([this] { return CanConnect(port_); });
  }
  void Stop() { program_.reset(); }
  int port() const { return port_; }
  std::string Log() const {
    std::ifstream file(folder_.path() + "/mosquitto.log");
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }

 private:
  const TestFolder& folder_;
  const int port_ = FreePort();
  std::string config_;
  std::unique_ptr<Program> program_;
};

struct Message {
  std::string topic;
  std::string payload;
};

// mosquitto_sub, with a session that the broker keeps for it.
class Listener {
 public:
  Listener(const TestFolder& folder, int port, std::vector<std::string> further = {})
      : file_(folder.path() + "/messages") {
    std::vector<std::string> arguments = {
        MOSQUITTO_SUB, "-h", "localhost", "-p", absl::StrCat(port), "-i", "listener",
        "-c",          "-q", "1",         "-t", "plant/#",          "-F", "%t %p"};
    arguments.insert(arguments.end(), further.begin(), further.end());
    program_ = std::make_unique<Program>(arguments, file_, SIGKILL);
  }
  std::vector<Message> messages() const {
    std::ifstream file(file_);
    std::vector<Message> messages;
    std::string line;
    while (std::getline(file, line) && !file.eof()) {  // the last line may not be complete
      const size_t space = line.find(' ');
      if (line.rfind("plant/", 0) != 0 || space == std::string::npos) continue;
      messages.push_back({line.substr(0, space), line.substr(space + 1)});
    }
    return messages;
  }
  std::vector<std::string> event_ids() const {
    std::vector<std::string> ids;
    for (const Message& message : messages()) {
      if (message.topic == "plant/vision/status") continue;
      ids.push_back(nlohmann::json::parse(message.payload)["event_id"]);
    }
    return ids;
  }
  std::string last_status() const {
    std::string status;
    for (const Message& message : messages()) {
      if (message.topic == "plant/vision/status") status = message.payload;
    }
    return status;
  }

 private:
  const std::string file_;
  std::unique_ptr<Program> program_;
};

class MqttReceiverTest : public ::testing::Test {
 protected:
  static std::unique_ptr<EventReceiver> Mqtt(MqttOptions options) {
    options.topic_prefix = "plant/vision";
    auto receiver = MakeMqttReceiver(options);
    EXPECT_TRUE(receiver.ok()) << receiver.status();
    return receiver.ok() ? *std::move(receiver) : nullptr;
  }
  static std::unique_ptr<EventReceiver> Mqtt(const Broker& broker) {
    MqttOptions options;
    options.url = absl::StrCat("tcp://localhost:", broker.port());
    return Mqtt(options);
  }

  TestFolder folder_;
  StoredEvents events_{folder_};
};

TEST_F(MqttReceiverTest, PublishesEventsInOrderAndSaysWhetherItIsThere) {
  const Broker broker(folder_);
  const Listener listener(folder_, broker.port());
  const std::string first = events_.AddJob();
  {
    EventDelivery delivery(events_.store(), Receivers(Mqtt(broker)), QuickRetries());
    WaitUntil([&] { return listener.last_status() == "online"; });
    for (int i = 0; i < 20; ++i) events_.AddJob();
    EXPECT_EQ(events_.FinishJob(), first);
    WaitUntil([&] { return listener.event_ids().size() >= events_.All().size(); });
  }
  WaitUntil([&] { return listener.last_status() == "offline"; });
  // The listener may have come after the first event.
  EXPECT_EQ(listener.event_ids(), events_.AllIds());
  const Message last = [&] {
    Message found;
    for (const Message& message : listener.messages()) {
      if (message.topic != "plant/vision/status") found = message;
    }
    return found;
  }();
  EXPECT_EQ(last.topic, absl::StrCat("plant/vision/jobs/", first, "/done"));
  const nlohmann::json event = nlohmann::json::parse(last.payload);
  EXPECT_EQ(event["type"], "done");
  EXPECT_EQ(event["job"]["job_id"], first);
  EXPECT_EQ(event["job"]["state"], "SUCCEEDED");
}

TEST_F(MqttReceiverTest, NothingIsLostWhenTheBrokerRestarts) {
  Broker broker(folder_);
  const Listener listener(folder_, broker.port());
  EventDelivery delivery(events_.store(), Receivers(Mqtt(broker)), QuickRetries());
  WaitUntil([&] { return listener.last_status() == "online"; });
  for (int i = 0; i < 5; ++i) events_.AddJob();
  WaitUntil([&] { return listener.event_ids().size() >= 5; });
  for (int round = 0; round < 2; ++round) {
    events_.AddJob();  // perhaps on its way when the broker ends
    broker.Stop();
    for (int i = 0; i < 5; ++i) events_.AddJob();
    WaitUntil([&] { return delivery.receivers()[0].is_failing; });
    broker.Start();
    events_.AddJob();
    WaitUntil(
        [&] { return WithoutRepetitions(listener.event_ids()).size() >= events_.All().size(); });
  }
  EXPECT_EQ(WithoutRepetitions(listener.event_ids()), events_.AllIds());
  WaitUntil([&] { return listener.last_status() == "online"; });
}

TEST_F(MqttReceiverTest, ComesBackByItselfWithoutEvents) {
  Broker broker(folder_);
  EventDelivery delivery(events_.store(), Receivers(Mqtt(broker)), QuickRetries());
  const Listener listener(folder_, broker.port());
  WaitUntil([&] { return listener.last_status() == "online"; });
  broker.Stop();
  WaitUntil([&] { return delivery.receivers()[0].is_failing; });
  broker.Start();
  WaitUntil([&] { return !delivery.receivers()[0].is_failing; });
}

TEST_F(MqttReceiverTest, GoesOnWhereItWasAfterARestart) {
  const Broker broker(folder_);
  const Listener listener(folder_, broker.port());
  {
    EventDelivery delivery(events_.store(), Receivers(Mqtt(broker)), QuickRetries());
    WaitUntil([&] { return listener.last_status() == "online"; });
    events_.AddJob();
    events_.AddJob();
    WaitUntil([&] { return delivery.receivers()[0].delivered_events == 2; });
  }
  events_.AddJob();  // while nobody delivers
  events_.Reopen();
  EventDelivery delivery(events_.store(), Receivers(Mqtt(broker)), QuickRetries());
  events_.AddJob();
  WaitUntil([&] { return listener.event_ids().size() >= 4; });
  EXPECT_EQ(WithoutRepetitions(listener.event_ids()), events_.AllIds());
}

TEST_F(MqttReceiverTest, DeadWebhookDoesNotHoldUpTheBroker) {
  const Broker broker(folder_);
  const Listener listener(folder_, broker.port());
  // Takes connections and never answers.
  const int dead = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  ASSERT_EQ(bind(dead, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  ASSERT_EQ(listen(dead, 10), 0);
  socklen_t size = sizeof(address);
  ASSERT_EQ(getsockname(dead, reinterpret_cast<sockaddr*>(&address), &size), 0);
  WebhookOptions webhook;
  webhook.url = absl::StrCat("http://127.0.0.1:", ntohs(address.sin_port), "/hook");
  webhook.secret_file = folder_.Write("secret", "a secret of the plant's");
  auto dead_receiver = MakeWebhookReceiver(webhook);
  ASSERT_TRUE(dead_receiver.ok()) << dead_receiver.status();

  EventDelivery delivery(events_.store(), Receivers(*std::move(dead_receiver), Mqtt(broker)),
                         QuickRetries());
  WaitUntil([&] { return listener.last_status() == "online"; });
  for (int i = 0; i < 10; ++i) events_.AddJob();
  WaitUntil([&] { return listener.event_ids().size() == 10; });
  EXPECT_EQ(listener.event_ids(), events_.AllIds());
  EXPECT_EQ(delivery.receivers()[0].delivered_events, 0);
  close(dead);
}

TEST_F(MqttReceiverTest, UsesTlsAndPasswords) {
  const TestAuthority authority("plant");
  const PemPair server = authority.Issue("localhost", "DNS:localhost");
  const PemPair client = authority.Issue("sightline");
  const std::string ca = folder_.Write("ca.pem", authority.certificate());
  folder_.Write("server.pem", server.certificate);
  folder_.Write("server.key", server.key);
  // user "vision", password "secret of the plant", by mosquitto_passwd's own format below.
  folder_.Write("acl", "user vision\ntopic readwrite plant/#\n");
  const std::string passwords = folder_.Write("passwords", "vision:secret of the plant\n");
  ASSERT_EQ(std::system(absl::StrCat("mosquitto_passwd -U ", passwords).c_str()), 0);
  const Broker broker(
      folder_, absl::StrCat("cafile ", ca, "\ncertfile ", folder_.path(), "/server.pem\nkeyfile ",
                            folder_.path(), "/server.key\nrequire_certificate true\n",
                            "allow_anonymous false\npassword_file ", passwords, "\n"));
  MqttOptions options;
  options.url = absl::StrCat("ssl://localhost:", broker.port());
  options.ca_file = ca;
  options.certificate_file = folder_.Write("client.pem", client.certificate);
  options.key_file = folder_.Write("client.key", client.key);
  options.credentials_file = folder_.Write("credentials", "vision\nsecret of the plant\n");
  const Listener listener(folder_, broker.port(),
                          {"--cafile", ca, "--cert", options.certificate_file, "--key",
                           options.key_file, "-u", "vision", "-P", "secret of the plant"});
  {
    EventDelivery delivery(events_.store(), Receivers(Mqtt(options)), QuickRetries());
    WaitUntil([&] { return listener.last_status() == "online"; });
    events_.AddJob();
    WaitUntil([&] { return listener.event_ids() == events_.AllIds(); });
  }
  // Every attempt must be refused, and one of the first few must say why. Paho 1.3.12 does not lock
  // its sockets while one is closed (mended in 1.3.13, its issue 1219): an attempt whose socket has
  // the number of the one before can end with that one's "socket error".
  const auto refused = [&](const MqttOptions& wrong, const std::string& reason) {
    constexpr int kAttempts = 5;
    JobEvent event;
    event.sequence = 1000;
    event.type = "done";
    event.job.job_id = "never";
    absl::Status status;
    for (int i = 0; i < kAttempts && !absl::StrContains(status.message(), reason); ++i) {
      status = Mqtt(wrong)->Deliver(event);
      ASSERT_EQ(status.code(), absl::StatusCode::kUnavailable) << status;
    }
    EXPECT_THAT(status.message(), HasSubstr(reason));
  };
  MqttOptions wrong = options;
  wrong.credentials_file = folder_.Write("wrong", "vision\nsomething else\n");
  refused(wrong, "broker");
  wrong = options;
  wrong.certificate_file.clear();
  wrong.key_file.clear();
  refused(wrong, "cannot connect");
  wrong = options;
  wrong.ca_file = folder_.Write("other.pem", TestAuthority("other").certificate());
  refused(wrong, "certificate verify failed");
  // The certificate is good, but not for this host.
  wrong = options;
  wrong.url = absl::StrCat("ssl://127.0.0.1:", broker.port());
  refused(wrong, "cannot connect");
  EXPECT_EQ(WithoutRepetitions(listener.event_ids()), events_.AllIds());
}

// Names of this process's threads.
std::vector<std::string> ThreadNames() {
  std::vector<std::string> names;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    std::ifstream file(task.path() / "comm");
    names.emplace_back();
    std::getline(file, names.back());
  }
  return names;
}

// A bug found: Paho ended its threads with the last client and freed their trace buffer while they
// still wrote to it. A receiver that came or went now and then crashed the process.
TEST_F(MqttReceiverTest, ThreadsOfPahoOutliveTheLastReceiver) {
  MqttOptions options;
  options.url = absl::StrCat("tcp://localhost:", FreePort());  // nobody listens
  EXPECT_EQ(Mqtt(options)->KeepReady().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(ThreadNames(), Contains("MQTTAsync_rcv"));
  EXPECT_THAT(ThreadNames(), Contains("MQTTAsync_send"));
}

TEST_F(MqttReceiverTest, HostThatDoesNotExist) {
  MqttOptions options;
  options.url = "ssl://broker.invalid";
  events_.AddJob();
  EventDelivery delivery(events_.store(), Receivers(Mqtt(options)), QuickRetries());
  WaitUntil([&] { return delivery.receivers()[0].is_failing; });
  delivery.Stop();
}

}  // namespace
}  // namespace sightline
