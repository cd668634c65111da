// SPDX-License-Identifier: Apache-2.0
// Answers of the HTTP front end: JSON, errors, bytes.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "planning_service/http/http_exchange.h"

namespace sightline {

// HTTP status of an error, from its code and reason.
int HttpStatusOf(const absl::Status& status);

// {"error": {"code", "reason", "message", "fields": [{"field", "description"}]}}
std::string ErrorJson(const absl::Status& status);

// Each sends a whole answer. Errors of the connection are dropped: the client is gone.
void ReplyText(HttpExchange& exchange, int http_status, const HttpHeaders& headers,
               const std::string& content_type, absl::string_view body);
void ReplyJson(HttpExchange& exchange, int http_status, const std::string& json,
               const HttpHeaders& headers = {});
// With Retry-After where trying again helps.
void ReplyError(HttpExchange& exchange, const absl::Status& status,
                const HttpHeaders& headers = {});

}  // namespace sightline
