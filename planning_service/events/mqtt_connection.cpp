// SPDX-License-Identifier: Apache-2.0
#include "planning_service/events/mqtt_connection.h"

#include <MQTTAsync.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "planning_service/events/interrupt_interval.h"

namespace sightline {
namespace {

constexpr int kQualityOfService = 1;
constexpr int kKeepAlive_s = 20;
constexpr size_t kMaxDetailBytes = 500;

// Codes 1 to 5 are the broker's (MQTT 3.1.1, table 3.1), negative ones Paho's.
std::string ReasonText(int code) {
  switch (code) {
    case 1:
      return "the broker refuses this version of MQTT";
    case 2:
      return "the broker refuses the client id";
    case 3:
      return "the broker is not available";
    case 4:
      return "the broker refuses user name or password";
    case 5:
      return "the broker does not allow it";
    default: {
      const char* text = MQTTAsync_strerror(code);
      return text != nullptr ? text : absl::StrCat("error ", code);
    }
  }
}

// Makes a client that never connects and is never destroyed, so that no other client is the last
// one. With its last client Paho 1.3.12 ends its two threads (MQTTAsync_terminate) and frees its
// trace buffer, although the threads may still write to it when they return.
void KeepThreadsOfPaho() {
  static const MQTTAsync kept = [] {
    MQTTAsync client = nullptr;
    MQTTAsync_create(&client, "tcp://localhost:1883", "sightline-idle", MQTTCLIENT_PERSISTENCE_NONE,
                     /*persistence_context=*/nullptr);
    return client;
  }();
  static_cast<void>(kept);
}

}  // namespace

// An event that happens once, in a thread of Paho.
class MqttConnection::Signal {
 public:
  void Set(bool good, const std::string& reason) {
    {
      std::lock_guard lock(mutex_);
      if (is_set_) return;
      is_set_ = true;
      good_ = good;
      reason_ = reason;
    }
    changed_.notify_all();
  }
  void AddDetail(const std::string& text) {
    std::lock_guard lock(mutex_);
    detail_ = (detail_ + text).substr(0, kMaxDetailBytes);
  }
  bool WaitFor(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, timeout, [this] { return is_set_; });
  }
  bool is_set() const {
    std::lock_guard lock(mutex_);
    return is_set_;
  }
  bool good() const {
    std::lock_guard lock(mutex_);
    return good_;
  }
  std::string reason() const {
    std::lock_guard lock(mutex_);
    return detail_.empty() ? reason_ : absl::StrCat(reason_, " (", detail_, ")");
  }

 private:
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool is_set_ = false;
  bool good_ = false;
  std::string reason_;
  std::string detail_;
};

// Paho may call back while its client is destroyed or later. Therefore it gets numbers instead of
// pointers, and unknown numbers are ignored.
class MqttConnection::Registration {
 public:
  Registration() {
    std::lock_guard lock(Mutex());
    number_ = ++Last();
    Table()[number_] = signal_;
  }
  ~Registration() {
    std::lock_guard lock(Mutex());
    Table().erase(number_);
  }
  Registration(const Registration&) = delete;
  Registration& operator=(const Registration&) = delete;

  Signal& signal() { return *signal_; }
  void* context() const {
    // The pointer holds a number that is looked up; it is never dereferenced.
    return reinterpret_cast<void*>(number_);  // NOLINT(performance-no-int-to-ptr)
  }

  static std::shared_ptr<Signal> Find(void* context) {
    std::lock_guard lock(Mutex());
    const auto found = Table().find(reinterpret_cast<uintptr_t>(context));
    return found == Table().end() ? nullptr : found->second;
  }

 private:
  // Never destroyed: Paho's threads may outlive static objects.
  static std::mutex& Mutex() {
    static auto* mutex = new std::mutex;
    return *mutex;
  }
  static std::map<uintptr_t, std::shared_ptr<Signal>>& Table() {
    static auto* table = new std::map<uintptr_t, std::shared_ptr<Signal>>;
    return *table;
  }
  static uintptr_t& Last() {
    static uintptr_t last = 0;
    return last;
  }

  const std::shared_ptr<Signal> signal_ = std::make_shared<Signal>();
  uintptr_t number_ = 0;
};

struct MqttConnection::Callbacks {
  static void OnSuccess(void* context, MQTTAsync_successData*) {
    if (const auto signal = Registration::Find(context)) signal->Set(true, "");
  }
  static void OnFailure(void* context, MQTTAsync_failureData* data) {
    const auto signal = Registration::Find(context);
    if (signal == nullptr) return;
    std::string reason = data != nullptr ? ReasonText(data->code) : "failed";
    if (data != nullptr && data->message != nullptr && data->code < 0) {
      reason = absl::StrCat(reason, ": ", data->message);
    }
    signal->Set(false, reason);
  }
  static void OnLost(void* context, char* cause) {
    const auto signal = Registration::Find(context);
    if (signal != nullptr) signal->Set(false, cause != nullptr ? cause : "connection lost");
  }
  static int OnTlsError(const char* text, size_t size, void* context) {
    if (const auto signal = Registration::Find(context)) {
      std::string line(text, size);
      absl::StripAsciiWhitespace(&line);
      signal->AddDetail(line);
    }
    return 1;
  }
};

MqttConnection::MqttConnection(const std::atomic<bool>& interrupted) : interrupted_(interrupted) {}

MqttConnection::~MqttConnection() {
  if (client_ != nullptr) MQTTAsync_destroy(&client_);
}

bool MqttConnection::IsConnected() const { return is_connected_ && !lost_->signal().is_set(); }

absl::Status MqttConnection::Await(Signal& done, const std::string& what, absl::Duration timeout,
                                   bool even_if_interrupted) const {
  const auto end = std::chrono::steady_clock::now() + absl::ToChronoNanoseconds(timeout);
  while (!done.WaitFor(kInterruptInterval)) {
    if (interrupted_ && !even_if_interrupted) return absl::CancelledError("interrupted");
    if (lost_->signal().is_set()) {
      return absl::UnavailableError(absl::StrCat(what, ": ", lost_->signal().reason()));
    }
    if (std::chrono::steady_clock::now() >= end) {
      return absl::UnavailableError(
          absl::StrCat(what, ": no answer within ", absl::FormatDuration(timeout)));
    }
  }
  if (done.good()) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat(what, ": ", done.reason()));
}

absl::Status MqttConnection::Connect(const MqttSettings& settings, absl::Duration timeout) {
  is_connected_ = false;
  KeepThreadsOfPaho();
  // Every attempt gets a new client, without state of an earlier attempt.
  if (client_ != nullptr) MQTTAsync_destroy(&client_);
  const int created =
      MQTTAsync_create(&client_, settings.uri.c_str(), settings.client_id.c_str(),
                       MQTTCLIENT_PERSISTENCE_NONE, /*persistence_context=*/nullptr);
  lost_ = std::make_unique<Registration>();
  if (created != MQTTASYNC_SUCCESS) {
    client_ = nullptr;
    return absl::UnavailableError(
        absl::StrCat("cannot make an MQTT client: ", ReasonText(created)));
  }
  MQTTAsync_setConnectionLostCallback(client_, lost_->context(), &Callbacks::OnLost);

  Registration connected;
  const auto text_or_null = [](const std::string& text) {
    return text.empty() ? nullptr : text.c_str();
  };
  MQTTAsync_willOptions will = MQTTAsync_willOptions_initializer;
  will.topicName = settings.will_topic.c_str();
  will.message = settings.will_payload.c_str();
  will.retained = 1;
  will.qos = kQualityOfService;
  MQTTAsync_SSLOptions tls = MQTTAsync_SSLOptions_initializer;
  tls.trustStore = text_or_null(settings.ca_file);
  tls.disableDefaultTrustStore = settings.ca_file.empty() ? 0 : 1;
  tls.keyStore = text_or_null(settings.certificate_file);
  tls.privateKey = text_or_null(settings.key_file);
  tls.enableServerCertAuth = 1;
  tls.verify = 1;  // the certificate must be the host's
  tls.sslVersion = MQTT_SSL_VERSION_TLS_1_2;
  tls.ssl_error_cb = &Callbacks::OnTlsError;
  tls.ssl_error_context = connected.context();

  MQTTAsync_connectOptions options = MQTTAsync_connectOptions_initializer;
  options.MQTTVersion = MQTTVERSION_3_1_1;
  options.cleansession = 1;
  options.keepAliveInterval = kKeepAlive_s;
  options.connectTimeout = static_cast<int>(std::max<int64_t>(1, absl::ToInt64Seconds(timeout)));
  options.will = &will;
  options.username = text_or_null(settings.user);
  options.password = text_or_null(settings.password);
  if (settings.uri.rfind("ssl://", 0) == 0) options.ssl = &tls;
  options.onSuccess = &Callbacks::OnSuccess;
  options.onFailure = &Callbacks::OnFailure;
  options.context = connected.context();
  const std::string what = absl::StrCat("cannot connect to ", settings.uri);
  if (const int asked = MQTTAsync_connect(client_, &options); asked != MQTTASYNC_SUCCESS) {
    return absl::UnavailableError(absl::StrCat(what, ": ", ReasonText(asked)));
  }
  absl::Status status = Await(connected.signal(), what, timeout, /*even_if_interrupted=*/false);
  is_connected_ = status.ok();
  return status;
}

absl::Status MqttConnection::Publish(const std::string& topic, const std::string& payload,
                                     bool retained, absl::Duration timeout,
                                     bool even_if_interrupted) {
  const std::string what = absl::StrCat("cannot publish to ", topic);
  if (!IsConnected()) return absl::UnavailableError(absl::StrCat(what, ": not connected"));
  Registration published;
  MQTTAsync_responseOptions options = MQTTAsync_responseOptions_initializer;
  options.onSuccess = &Callbacks::OnSuccess;
  options.onFailure = &Callbacks::OnFailure;
  options.context = published.context();
  const int asked = MQTTAsync_send(client_, topic.c_str(), static_cast<int>(payload.size()),
                                   payload.data(), kQualityOfService, retained ? 1 : 0, &options);
  if (asked != MQTTASYNC_SUCCESS) {
    is_connected_ = false;
    return absl::UnavailableError(absl::StrCat(what, ": ", ReasonText(asked)));
  }
  absl::Status status = Await(published.signal(), what, timeout, even_if_interrupted);
  // If the broker does not answer, the message is sent again over a new connection.
  if (absl::IsUnavailable(status)) is_connected_ = false;
  return status;
}

}  // namespace sightline
