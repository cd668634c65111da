// SPDX-License-Identifier: Apache-2.0
// Addresses that servers listen on.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace sightline {

// "unix:PATH".
bool IsUnixAddress(const std::string& address);

// The host of HOST:PORT or [V6]:PORT, without brackets. INVALID_ARGUMENT names `option`: the
// address has another form.
absl::StatusOr<std::string> HostOfAddress(const std::string& option, const std::string& address);

// True if only this machine reaches `host`: all addresses of the name or literal are loopback
// addresses. UNAVAILABLE: the name is not known.
absl::StatusOr<bool> IsLoopbackHost(const std::string& host);

}  // namespace sightline
