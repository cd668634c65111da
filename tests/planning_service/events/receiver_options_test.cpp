// SPDX-License-Identifier: Apache-2.0
// Receiver options that are refused before anything is sent.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "planning_service/events/mqtt_receiver.h"
#include "planning_service/events/receiver_url.h"
#include "planning_service/events/webhook_receiver.h"
#include "stored_events.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

std::string ErrorOf(const absl::Status& status) {
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
  return std::string(status.message());
}

class ReceiverOptionsTest : public ::testing::Test {
 protected:
  absl::Status Webhook(const std::string& url, bool allow_plaintext = false) {
    WebhookOptions options;
    options.url = url;
    options.secret_file = secret_;
    options.allow_plaintext = allow_plaintext;
    return MakeWebhookReceiver(options).status();
  }
  absl::Status Mqtt(const std::string& url, bool allow_plaintext = false) {
    MqttOptions options;
    options.url = url;
    options.allow_plaintext = allow_plaintext;
    return MakeMqttReceiver(options).status();
  }

  TestFolder folder_;
  const std::string secret_ = folder_.Write("secret", "a secret of the plant's\n");
};

TEST_F(ReceiverOptionsTest, PlainTextStaysOnTheMachine) {
  for (const char* url : {"http://localhost:1/x", "http://127.8.0.1/x", "http://[::1]:8080/",
                          "https://mes.plant/hook"}) {
    EXPECT_TRUE(Webhook(url).ok()) << url << ": " << Webhook(url);
  }
  for (const char* url : {"http://mes.plant/x", "http://10.0.0.1/x", "http://[fe80::1]/x",
                          "http://localhost.mes.plant/", "http://128.0.0.1/"}) {
    EXPECT_THAT(ErrorOf(Webhook(url)), HasSubstr("use https")) << url;
    EXPECT_TRUE(Webhook(url, true).ok()) << url;
  }
  for (const char* url :
       {"tcp://localhost", "mqtt://127.0.0.1:1", "ssl://broker", "mqtts://[::2]"}) {
    EXPECT_TRUE(Mqtt(url).ok()) << url << ": " << Mqtt(url);
  }
  for (const char* url : {"tcp://broker", "mqtt://10.0.0.1:1883"}) {
    EXPECT_THAT(ErrorOf(Mqtt(url)), HasSubstr("use ssl://")) << url;
    EXPECT_TRUE(Mqtt(url, true).ok()) << url;
  }
}

TEST_F(ReceiverOptionsTest, UrlsAreChecked) {
  for (const char* url : {"", "mes.plant", "ftp://localhost/", "http://", "http://localhost:0/",
                          "http://localhost:70000/", "http://local host/", "http://localhost/\n"}) {
    EXPECT_THAT(ErrorOf(Webhook(url)), HasSubstr("--webhook")) << url;
  }
  EXPECT_THAT(ErrorOf(Webhook("http://localhost/" + std::string(3000, 'x'))), HasSubstr("2048"));
  for (const char* url : {"", "http://localhost", "tcp://localhost/topic", "tcp://:1883"}) {
    EXPECT_THAT(ErrorOf(Mqtt(url)), HasSubstr("--mqtt")) << url;
  }
}

TEST_F(ReceiverOptionsTest, SecretsInUrlsAreRefusedAndNotRepeated) {
  const std::string password = "hunter2";
  EXPECT_THAT(ErrorOf(Webhook(absl::StrCat("https://me:", password, "@mes.plant/"))),
              Not(HasSubstr(password)));
  EXPECT_THAT(ErrorOf(Mqtt(absl::StrCat("ssl://me:", password, "@broker"))),
              AllOf(HasSubstr("--mqtt"), Not(HasSubstr(password))));
  WebhookOptions options;
  options.url = "https://mes.plant/hook?key=" + password;
  options.secret_file = secret_;
  auto receiver = MakeWebhookReceiver(options);
  ASSERT_TRUE(receiver.ok()) << receiver.status();
  EXPECT_THAT((*receiver)->name(),
              AllOf(HasSubstr("webhook:mes.plant:443:"), Not(HasSubstr(password))));
  options.url += "3";
  auto other = MakeWebhookReceiver(options);
  ASSERT_TRUE(other.ok());
  EXPECT_NE((*receiver)->name(), (*other)->name());
}

TEST_F(ReceiverOptionsTest, FilesAreChecked) {
  WebhookOptions webhook;
  webhook.url = "https://mes.plant/";
  EXPECT_THAT(ErrorOf(MakeWebhookReceiver(webhook).status()), HasSubstr("--webhook-secret"));
  webhook.secret_file = folder_.Write("short", "too short\n");
  EXPECT_THAT(ErrorOf(MakeWebhookReceiver(webhook).status()),
              AllOf(HasSubstr("shorter than 16"), Not(HasSubstr("too short"))));
  webhook.secret_file = folder_.Write("long", std::string(5000, 'x'));
  EXPECT_THAT(ErrorOf(MakeWebhookReceiver(webhook).status()), HasSubstr("longer than 4096"));
  webhook.secret_file = folder_.path();
  EXPECT_THAT(ErrorOf(MakeWebhookReceiver(webhook).status()), HasSubstr("regular file"));
  webhook.secret_file = secret_;
  webhook.ca_file = "/nonexistent/ca.pem";
  EXPECT_THAT(ErrorOf(MakeWebhookReceiver(webhook).status()), HasSubstr("/nonexistent/ca.pem"));

  MqttOptions mqtt;
  mqtt.url = "ssl://broker";
  mqtt.credentials_file = folder_.Write("one-line", "user\n");
  EXPECT_THAT(ErrorOf(MakeMqttReceiver(mqtt).status()), HasSubstr("two lines"));
  mqtt.credentials_file = folder_.Write("two-lines", "user\npass word\n");
  EXPECT_TRUE(MakeMqttReceiver(mqtt).ok());
  mqtt.certificate_file = secret_;
  EXPECT_THAT(ErrorOf(MakeMqttReceiver(mqtt).status()), HasSubstr("belong together"));
  mqtt.certificate_file.clear();
  mqtt.ca_file = "/nonexistent/ca.pem";
  EXPECT_THAT(ErrorOf(MakeMqttReceiver(mqtt).status()), HasSubstr("--mqtt-ca"));
  mqtt.url = "tcp://localhost";
  EXPECT_THAT(ErrorOf(MakeMqttReceiver(mqtt).status()), HasSubstr("ssl://"));
  mqtt.ca_file.clear();
  for (const char* prefix : {"", "a/#", "+/a", "/a", "a/", "$SYS", "a\nb"}) {
    mqtt.topic_prefix = prefix;
    EXPECT_THAT(ErrorOf(MakeMqttReceiver(mqtt).status()), HasSubstr("--mqtt-prefix")) << prefix;
  }
}

}  // namespace
}  // namespace sightline
