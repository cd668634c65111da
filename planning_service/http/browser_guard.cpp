// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http/browser_guard.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

// "Localhost.:8080" -> "localhost", "[::1]:8080" -> "::1". None of a text that is not a host with
// or without a port (RFC 9110 7.2, RFC 3986 3.2), such as "localhost:80@evil.com".
std::optional<std::string> HostName(const std::string& authority) {
  std::string text = absl::AsciiStrToLower(authority);
  const bool in_brackets = absl::StartsWith(text, "[");
  const size_t end = in_brackets ? text.find(']') : text.find(':');
  if (in_brackets && end == std::string::npos) return std::nullopt;
  std::string name = in_brackets ? text.substr(1, end - 1) : text.substr(0, end);
  absl::string_view port = end == std::string::npos
                               ? absl::string_view()
                               : absl::string_view(text).substr(in_brackets ? end + 1 : end);
  const bool has_port = absl::ConsumePrefix(&port, ":");
  const auto is_digit = [](char c) { return absl::ascii_isdigit(static_cast<unsigned char>(c)); };
  const auto belongs_to_name = [&](char c) {
    return absl::ascii_isalnum(static_cast<unsigned char>(c)) ||
           absl::StrContains(in_brackets ? ":.%" : "-._~", c);
  };
  if (!std::all_of(name.begin(), name.end(), belongs_to_name)) return std::nullopt;
  if (!has_port && !port.empty()) return std::nullopt;
  if (port.size() > 5 || !std::all_of(port.begin(), port.end(), is_digit)) return std::nullopt;
  if (!in_brackets && absl::EndsWith(name, ".")) name.pop_back();
  return name;
}

// "https://Host:443" -> "host"; the default ports are left out, as browsers do.
std::string Authority(absl::string_view text) {
  for (const absl::string_view scheme : {"http://", "https://"}) {
    if (absl::StartsWith(text, scheme)) text.remove_prefix(scheme.size());
  }
  if (!absl::ConsumeSuffix(&text, ":80")) absl::ConsumeSuffix(&text, ":443");
  return absl::AsciiStrToLower(text);
}

}  // namespace

BrowserGuard::BrowserGuard(std::vector<std::string> names) : names_(std::move(names)) {
  for (std::string& name : names_) {
    // An IPv6 address without brackets would be cut at its first colon.
    const bool bare_ipv6 = std::count(name.begin(), name.end(), ':') > 1 && name.front() != '[';
    name = HostName(bare_ipv6 ? absl::StrCat("[", name, "]") : name).value_or(name);
  }
}

absl::Status BrowserGuard::Check(const HttpRequest& request) const {
  const std::string host = request.Header("host");
  const std::optional<std::string> name = HostName(host);
  if (!names_.empty() &&
      (!name || std::find(names_.begin(), names_.end(), *name) == names_.end())) {
    return WithErrorInfo(
        absl::PermissionDeniedError(absl::StrCat("Host: this server is not called \"",
                                                 absl::CHexEscape(host.substr(0, 200)), "\"")),
        "HOST_NOT_ALLOWED");
  }
  if (request.method == "GET" || request.method == "HEAD" || request.method == "OPTIONS") {
    return absl::OkStatus();
  }
  const std::string origin = request.Header("origin");
  const std::string site = request.Header("sec-fetch-site");
  // "null" is the origin of sandboxed pages, such as the reports served here.
  const bool same_origin = origin.empty() || Authority(origin) == Authority(host);
  if (!same_origin || site == "cross-site" || site == "same-site") {
    return WithErrorInfo(absl::PermissionDeniedError(absl::StrCat(
                             "Origin: pages of ", origin.empty() ? "other sites" : origin,
                             " cannot change anything here")),
                         "ORIGIN_NOT_ALLOWED");
  }
  return absl::OkStatus();
}

}  // namespace sightline
