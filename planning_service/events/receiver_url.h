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
  // "localhost" or a literal loopback address: nothing leaves the machine.
  bool is_loopback = false;
};

// INVALID_ARGUMENT names `option` and reason: not a URL of at most 2048 bytes, or one with user
// name or password, which are not repeated.
absl::StatusOr<ReceiverUrl> ParseReceiverUrl(const std::string& option, const std::string& url);

// "KIND:HOST:PORT:1a2b3c4d5e6f", the last from all of `identity`: a name to remember a receiver by
// that shows no secret that a URL may carry.
std::string ReceiverName(const std::string& kind, const ReceiverUrl& url,
                         const std::string& identity);

// First 12 hex digits of the SHA-256.
std::string ShortDigest(const std::string& text);

}  // namespace sightline
