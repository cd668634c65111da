// SPDX-License-Identifier: Apache-2.0
#include "planning_service/events/receiver_url.h"

#include <arpa/inet.h>
#include <curl/curl.h>

#include <algorithm>
#include <memory>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "core/digest/sha256.h"
#include "core/text/number.h"

namespace sightline {
namespace {

constexpr size_t kMaxUrlBytes = 2048;

std::string Part(CURLU* url, CURLUPart part) {
  char* text = nullptr;
  if (curl_url_get(url, part, &text, 0) != CURLUE_OK) return "";
  const std::unique_ptr<char, decltype(&curl_free)> owned(text, &curl_free);
  return text;
}

bool IsLoopback(const std::string& host) {
  if (host == "localhost") return true;
  in_addr v4{};
  if (inet_pton(AF_INET, host.c_str(), &v4) == 1) return (ntohl(v4.s_addr) >> 24) == 127;
  in6_addr v6{};
  return inet_pton(AF_INET6, host.c_str(), &v6) == 1 && IN6_IS_ADDR_LOOPBACK(&v6);
}

}  // namespace

absl::StatusOr<ReceiverUrl> ParseReceiverUrl(const std::string& option, const std::string& url) {
  const auto error = [&](const std::string& reason) {
    return absl::InvalidArgumentError(absl::StrCat(option, ": ", reason));
  };
  if (url.size() > kMaxUrlBytes) {
    return error(absl::StrCat("longer than ", kMaxUrlBytes, " bytes"));
  }
  const bool printable =
      std::all_of(url.begin(), url.end(), [](unsigned char c) { return absl::ascii_isgraph(c); });
  const std::unique_ptr<CURLU, decltype(&curl_url_cleanup)> parsed(curl_url(), &curl_url_cleanup);
  if (!printable || parsed == nullptr ||
      curl_url_set(parsed.get(), CURLUPART_URL, url.c_str(), CURLU_NON_SUPPORT_SCHEME) !=
          CURLUE_OK) {
    return error("not a URL of the form SCHEME://HOST:PORT");
  }
  if (!Part(parsed.get(), CURLUPART_USER).empty() ||
      !Part(parsed.get(), CURLUPART_PASSWORD).empty()) {
    return error(
        "has a user name or password, which every user of this machine could read; give them by a "
        "file");
  }
  ReceiverUrl result;
  result.scheme = absl::AsciiStrToLower(Part(parsed.get(), CURLUPART_SCHEME));
  result.host = absl::AsciiStrToLower(Part(parsed.get(), CURLUPART_HOST));
  result.path = Part(parsed.get(), CURLUPART_PATH);
  if (result.path.empty()) result.path.push_back('/');
  if (result.host.size() >= 2 && result.host.front() == '[' && result.host.back() == ']') {
    result.host = result.host.substr(1, result.host.size() - 2);
  }
  if (result.host.empty()) return error("has no host");
  const std::string port = Part(parsed.get(), CURLUPART_PORT);
  if (!port.empty()) {
    const auto number = ParseUnsigned(port);
    if (!number.ok() || *number < 1 || *number > 65535) {
      return error("has a port outside [1, 65535]");
    }
    result.port = static_cast<int>(*number);
  }
  result.is_loopback = IsLoopback(result.host);
  return result;
}

std::string ShortDigest(const std::string& text) { return Sha256Hex(text).substr(0, 12); }

std::string ReceiverName(const std::string& kind, const ReceiverUrl& url,
                         const std::string& identity) {
  return absl::StrCat(kind, ":", url.host, ":", url.port, ":", ShortDigest(identity));
}

}  // namespace sightline
