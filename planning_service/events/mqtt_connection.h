// SPDX-License-Identifier: Apache-2.0
// A connection to an MQTT broker (3.1.1), over Eclipse Paho's asynchronous client.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace sightline {

struct MqttSettings {
  std::string uri;  // tcp://HOST:PORT or ssl://HOST:PORT
  std::string client_id;
  std::string user;      // empty: none
  std::string password;  // of the user; empty: none
  // PEM files: the authorities of the broker (empty: the system's), our certificate and its key.
  std::string ca_file;
  std::string certificate_file;
  std::string key_file;
  // Message that the broker publishes, retained, when the connection breaks.
  std::string will_topic;
  std::string will_payload;
};

// Not thread-safe. Waiting calls end within 50 ms once `interrupted` is true.
class MqttConnection {
 public:
  explicit MqttConnection(const std::atomic<bool>& interrupted);
  ~MqttConnection();
  MqttConnection(const MqttConnection&) = delete;
  MqttConnection& operator=(const MqttConnection&) = delete;

  // Replaces an earlier connection. UNAVAILABLE with the reason; CANCELLED.
  absl::Status Connect(const MqttSettings& settings, absl::Duration timeout);
  // False once either end has closed the connection, as far as this is known.
  bool IsConnected() const;
  // Publishes with quality of service 1. OK: the broker has the message. UNAVAILABLE, CANCELLED:
  // the broker may have it or not. `even_if_interrupted`: waits for the whole timeout.
  absl::Status Publish(const std::string& topic, const std::string& payload, bool retained,
                       absl::Duration timeout, bool even_if_interrupted = false);

 private:
  class Signal;
  class Registration;
  struct Callbacks;

  // OK: `done` reports success. UNAVAILABLE: it reports failure, the connection was lost, or the
  // timeout is over.
  absl::Status Await(Signal& done, const std::string& what, absl::Duration timeout,
                     bool even_if_interrupted) const;

  const std::atomic<bool>& interrupted_;
  void* client_ = nullptr;              // MQTTAsync
  std::unique_ptr<Registration> lost_;  // set once the connection breaks
  bool is_connected_ = false;
};

}  // namespace sightline
