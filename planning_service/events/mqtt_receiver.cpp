// SPDX-License-Identifier: Apache-2.0
#include "planning_service/events/mqtt_receiver.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "planning_service/events/event_json.h"
#include "planning_service/events/mqtt_connection.h"
#include "planning_service/events/read_secret.h"
#include "planning_service/events/receiver_url.h"
#include "planning_service/events/resolve_host.h"

namespace sightline {
namespace {

constexpr char kMqttUrlOption[] = "--mqtt";
constexpr char kPrefixOption[] = "--mqtt-prefix";
constexpr char kCredentialsOption[] = "--mqtt-credentials";
constexpr char kOnline[] = "online";
constexpr char kOffline[] = "offline";
constexpr size_t kMaxPrefixBytes = 200;
constexpr absl::Duration kResolveTimeout = absl::Seconds(5);
constexpr absl::Duration kConnectTimeout = absl::Seconds(10);
constexpr absl::Duration kPublishTimeout = absl::Seconds(5);
// If the message does not arrive in this time, the broker sets the status when the connection ends.
constexpr absl::Duration kGoodbyeTimeout = absl::Milliseconds(200);

struct Credentials {
  std::string user;
  std::string password;
};

std::string Environment(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : "";
}

absl::StatusOr<Credentials> ReadCredentials(const std::string& file) {
  if (file.empty()) {
    Credentials credentials{Environment("SIGHTLINE_MQTT_USER"),
                            Environment("SIGHTLINE_MQTT_PASSWORD")};
    if (credentials.user.empty() && !credentials.password.empty()) {
      return absl::InvalidArgumentError("SIGHTLINE_MQTT_PASSWORD needs SIGHTLINE_MQTT_USER");
    }
    return credentials;
  }
  SIGHTLINE_ASSIGN_OR_RETURN(std::string text, ReadSecret(kCredentialsOption, file));
  const size_t end = text.find('\n');
  Credentials credentials{text.substr(0, end),
                          end == std::string::npos ? "" : text.substr(end + 1)};
  if (!credentials.user.empty() && credentials.user.back() == '\r') credentials.user.pop_back();
  if (credentials.user.empty() || credentials.password.empty() ||
      absl::StrContains(credentials.password, "\n")) {
    return absl::InvalidArgumentError(absl::StrCat(
        kCredentialsOption, " ", file, ": must have two lines, the user name and the password"));
  }
  return credentials;
}

absl::Status CheckPrefix(const std::string& prefix) {
  const bool has_forbidden = std::any_of(prefix.begin(), prefix.end(), [](unsigned char c) {
    return c == '+' || c == '#' || c < 0x20 || c >= 0x7f;
  });
  if (prefix.empty() || prefix.size() > kMaxPrefixBytes || has_forbidden || prefix.front() == '/' ||
      prefix.back() == '/' || prefix.front() == '$') {
    return absl::InvalidArgumentError(
        absl::StrCat(kPrefixOption, ": must be 1 to ", kMaxPrefixBytes,
                     " characters of ASCII without '+' and '#', not beginning with '/' or '$' nor "
                     "ending with '/'"));
  }
  return absl::OkStatus();
}

class MqttReceiver final : public EventReceiver {
 public:
  MqttReceiver(MqttOptions options, ReceiverUrl url, bool is_tls)
      : options_(std::move(options)), url_(std::move(url)), connection_(interrupted_) {
    const bool is_v6 = absl::StrContains(url_.host, ":");
    settings_.uri = absl::StrCat(is_tls ? "ssl://" : "tcp://", is_v6 ? "[" : "", url_.host,
                                 is_v6 ? "]" : "", ":", url_.port);
    // The id stays the same across restarts, so that the broker ends the earlier connection.
    settings_.client_id = absl::StrCat("sightline-", ShortDigest(options_.topic_prefix));
    settings_.ca_file = options_.ca_file;
    settings_.certificate_file = options_.certificate_file;
    settings_.key_file = options_.key_file;
    settings_.will_topic = StatusTopic();
    settings_.will_payload = kOffline;
  }

  ~MqttReceiver() override {
    if (!connection_.IsConnected()) return;
    connection_
        .Publish(StatusTopic(), kOffline, /*retained=*/true, kGoodbyeTimeout,
                 /*even_if_interrupted=*/true)
        .IgnoreError();
  }

  std::string name() override {
    return ReceiverName("mqtt", url_, absl::StrCat(options_.url, " ", options_.topic_prefix));
  }

  void Interrupt() override { interrupted_ = true; }

  absl::Status KeepReady() override {
    if (connection_.IsConnected()) return absl::OkStatus();
    SIGHTLINE_ASSIGN_OR_RETURN(Credentials credentials, ReadCredentials(options_.credentials_file));
    settings_.user = credentials.user;
    settings_.password = credentials.password;
    // Paho holds a lock that all its clients need while it looks up a name. So it only gets names
    // that are known to resolve.
    SIGHTLINE_RETURN_IF_ERROR(CheckHostResolves(url_.host, kResolveTimeout, interrupted_));
    SIGHTLINE_RETURN_IF_ERROR(connection_.Connect(settings_, kConnectTimeout));
    return connection_.Publish(StatusTopic(), kOnline, /*retained=*/true, kPublishTimeout);
  }

  absl::Status Deliver(const JobEvent& event) override {
    SIGHTLINE_RETURN_IF_ERROR(KeepReady());
    return connection_.Publish(
        absl::StrCat(options_.topic_prefix, "/jobs/", event.job.job_id, "/", event.type),
        EventJson(event), /*retained=*/false, kPublishTimeout);
  }

 private:
  std::string StatusTopic() const { return options_.topic_prefix + "/status"; }

  const MqttOptions options_;
  const ReceiverUrl url_;
  std::atomic<bool> interrupted_ = false;
  MqttSettings settings_;
  MqttConnection connection_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<EventReceiver>> MakeMqttReceiver(const MqttOptions& options) {
  SIGHTLINE_ASSIGN_OR_RETURN(ReceiverUrl url, ParseReceiverUrl(kMqttUrlOption, options.url));
  const bool is_tls = url.scheme == "ssl" || url.scheme == "mqtts";
  if (!is_tls && url.scheme != "tcp" && url.scheme != "mqtt") {
    return absl::InvalidArgumentError(
        absl::StrCat(kMqttUrlOption, ": scheme ", url.scheme, " must be ssl, mqtts, tcp or mqtt"));
  }
  if (url.path != "/") {
    return absl::InvalidArgumentError(absl::StrCat(
        kMqttUrlOption, ": ends after host and port; topics are set by ", kPrefixOption));
  }
  if (!is_tls && !url.is_loopback && !options.allow_plaintext) {
    return absl::InvalidArgumentError(absl::StrCat(
        kMqttUrlOption, ": ", url.scheme, " to ", url.host,
        " would send job events and password over the network in plain text; use ssl://, or allow "
        "it with --allow-plaintext"));
  }
  if (url.port == 0) url.port = is_tls ? 8883 : 1883;
  SIGHTLINE_RETURN_IF_ERROR(CheckPrefix(options.topic_prefix));
  if (options.certificate_file.empty() != options.key_file.empty()) {
    return absl::InvalidArgumentError("--mqtt-cert and --mqtt-key belong together");
  }
  for (const auto& [option, file] : {std::pair{"--mqtt-ca", &options.ca_file},
                                     std::pair{"--mqtt-cert", &options.certificate_file},
                                     std::pair{"--mqtt-key", &options.key_file}}) {
    if (file->empty()) continue;
    if (!is_tls) {
      return absl::InvalidArgumentError(
          absl::StrCat(option, " needs an address of the form ssl://HOST:PORT"));
    }
    if (access(file->c_str(), R_OK) != 0) {
      return absl::InvalidArgumentError(absl::StrCat(option, " ", *file, ": cannot be read"));
    }
  }
  SIGHTLINE_RETURN_IF_ERROR(ReadCredentials(options.credentials_file).status());
  return std::make_unique<MqttReceiver>(options, std::move(url), is_tls);
}

}  // namespace sightline
