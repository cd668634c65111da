// SPDX-License-Identifier: Apache-2.0
// Job events to an MQTT broker.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "planning_service/events/event_receiver.h"

namespace sightline {

struct MqttOptions {
  // ssl://HOST[:PORT] or mqtts://…; tcp://HOST[:PORT] or mqtt://… only to this machine, unless
  // plain text is allowed. Default ports 8883 (TLS) and 1883.
  std::string url;
  // First part of all topics; each service at a broker needs its own. 1 to 200 bytes without '+'
  // and '#', not beginning or ending with '/'.
  std::string topic_prefix = "sightline";
  // File of two lines, user name and password; read for every connection. Empty: the environment
  // variables SIGHTLINE_MQTT_USER and SIGHTLINE_MQTT_PASSWORD count, if they are set.
  std::string credentials_file;
  // PEM files: the authorities of the broker (empty: the system's), our certificate and its key.
  std::string ca_file;
  std::string certificate_file;
  std::string key_file;
  bool allow_plaintext = false;
};

// Publishes EventJson to PREFIX/jobs/JOB_ID/TYPE with quality of service 1, and keeps the retained
// message PREFIX/status at "online" while connected, "offline" otherwise. Connects when it is first
// used.
// INVALID_ARGUMENT names option and reason.
absl::StatusOr<std::unique_ptr<EventReceiver>> MakeMqttReceiver(const MqttOptions& options);

}  // namespace sightline
