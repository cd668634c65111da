// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http/browser_guard.h"

#include <algorithm>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

// "Localhost.:8080" -> "localhost", "[::1]:8080" -> "::1".
std::string HostName(const std::string& authority) {
  std::string name = absl::AsciiStrToLower(authority);
  if (!name.empty() && name.front() == '[') {
    return name.substr(1, std::min(name.find(']'), name.size()) - 1);
  }
  name = name.substr(0, name.find(':'));
  if (!name.empty() && name.back() == '.') name.pop_back();
  return name;
}

// "https://Host:443" -> "host"; ports that are usual are left out, since browsers do so.
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
    name = HostName(bare_ipv6 ? absl::StrCat("[", name, "]") : name);
  }
}

absl::Status BrowserGuard::Check(const HttpRequest& request) const {
  const std::string host = request.Header("host");
  if (!names_.empty() && std::find(names_.begin(), names_.end(), HostName(host)) == names_.end()) {
    return WithErrorInfo(absl::PermissionDeniedError(absl::StrCat(
                             "Host: this server is not called \"", HostName(host), "\"")),
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
