// SPDX-License-Identifier: Apache-2.0
// Prints errors on stderr.
#pragma once

#include <string>
#include <string_view>

namespace sightline {

// Prints one error on stderr: "sightline: MESSAGE" for people, or after UseJsonProgress() an object
// {"error": {"code", "reason", "message"}}. `code`: name of an absl::StatusCode such as
// "NOT_FOUND"; `reason`: that of google.rpc.ErrorInfo, or empty. A message with several lines has
// one error per line (core/json/error_list.h).
void PrintError(std::string_view code, std::string_view reason, const std::string& message);

}  // namespace sightline
