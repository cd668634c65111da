// SPDX-License-Identifier: Apache-2.0
// Job events by HTTP POST.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "planning_service/events/event_receiver.h"

namespace sightline {

struct WebhookOptions {
  // https://HOST[:PORT]/PATH; http:// only to this machine, unless plain text is allowed.
  std::string url;
  // File of the secret shared with the receiver: 16 bytes to 4 KiB, without a line break at the
  // end. Read for every event, so that the secret can be changed.
  std::string secret_file;
  // PEM file of the authorities of the receiver; empty: the system's.
  std::string ca_file;
  bool allow_plaintext = false;
  // Timeout of one delivery, 100 ms to 30 s.
  absl::Duration timeout = absl::Seconds(10);
};

// Posts EventJson with the headers
//   X-Sightline-Event: TYPE
//   X-Sightline-Delivery: EVENT_ID (the same when it is sent again)
//   X-Sightline-Signature: sha256=HEX, the HMAC-SHA256 of the body under the secret.
// A 2xx answer is success, and 410 Gone ends the receiver. Redirections are not followed and count
// as failures.
// INVALID_ARGUMENT names option and reason.
absl::StatusOr<std::unique_ptr<EventReceiver>> MakeWebhookReceiver(const WebhookOptions& options);

}  // namespace sightline
