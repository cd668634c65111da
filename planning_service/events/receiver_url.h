// SPDX-License-Identifier: Apache-2.0
// Addresses of receivers.
#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace sightline {

struct ReceiverUrl {
  std::string scheme;  // lower case
  std::string host;    // an IPv6 address without its brackets
  int port = 0;        // 0: none given
  std::string path;    // "/" if none
  // True for "localhost" and literal loopback addresses: no data leaves the machine.
  bool is_loopback = false;
};

// INVALID_ARGUMENT names `option` and reason: not a URL of at most 2048 bytes, or a URL with user
// name or password, which the message does not repeat.
absl::StatusOr<ReceiverUrl> ParseReceiverUrl(const std::string& option, const std::string& url);

// Name under which a receiver is remembered, "KIND:HOST:PORT:1a2b3c4d5e6f". The last field is a
// digest of all of `identity`, so that the name shows no secret that a URL may hold.
std::string ReceiverName(const std::string& kind, const ReceiverUrl& url,
                         const std::string& identity);

// First 12 hex digits of the SHA-256.
std::string ShortDigest(const std::string& text);

}  // namespace sightline
