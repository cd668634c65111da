// SPDX-License-Identifier: Apache-2.0
#include "planning_service/events/webhook_receiver.h"

#include <curl/curl.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <unistd.h>

#include <atomic>
#include <mutex>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "planning_service/events/event_json.h"
#include "planning_service/events/read_secret.h"
#include "planning_service/events/receiver_url.h"

namespace sightline {
namespace {

constexpr char kWebhookUrlOption[] = "--webhook";
constexpr char kSecretOption[] = "--webhook-secret";
constexpr size_t kMinSecretBytes = 16;
// The answer's body is ignored, but up to this much is read so that the connection can be reused.
constexpr size_t kMaxAnswerBytes = 64 << 10;

absl::StatusOr<std::string> ReadWebhookSecret(const std::string& file) {
  absl::StatusOr<std::string> secret = ReadSecret(kSecretOption, file);
  if (secret.ok() && secret->size() < kMinSecretBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat(kSecretOption, " ", file, ": is shorter than ", kMinSecretBytes, " bytes"));
  }
  return secret;
}

std::string Signature(const std::string& secret, const std::string& body) {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int size = 0;
  HMAC(EVP_sha256(), secret.data(), static_cast<int>(secret.size()),
       reinterpret_cast<const unsigned char*>(body.data()), body.size(), digest, &size);
  return absl::BytesToHexString(std::string(reinterpret_cast<const char*>(digest), size));
}

size_t CountAnswer(char*, size_t, size_t count, void* bytes) {
  *static_cast<size_t*>(bytes) += count;
  return *static_cast<size_t*>(bytes) <= kMaxAnswerBytes ? count : 0;
}

struct Headers {
  curl_slist* list = nullptr;

  Headers() = default;
  Headers(const Headers&) = delete;
  Headers& operator=(const Headers&) = delete;
  ~Headers() { curl_slist_free_all(list); }
  void Add(const std::string& line) { list = curl_slist_append(list, line.c_str()); }
};

class WebhookReceiver final : public EventReceiver {
 public:
  WebhookReceiver(WebhookOptions options, ReceiverUrl url)
      : options_(std::move(options)),
        url_(std::move(url)),
        multi_(curl_multi_init(), &curl_multi_cleanup) {}

  std::string name() override { return ReceiverName("webhook", url_, options_.url); }

  void Interrupt() override {
    interrupted_ = true;
    if (multi_ != nullptr) curl_multi_wakeup(multi_.get());
  }

  absl::Status Deliver(const JobEvent& event) override {
    SIGHTLINE_ASSIGN_OR_RETURN(std::string secret, ReadWebhookSecret(options_.secret_file));
    const std::string body = EventJson(event);
    Headers headers;
    headers.Add("Content-Type: application/json");
    headers.Add("Expect:");
    headers.Add(absl::StrCat("X-Sightline-Event: ", event.type));
    headers.Add(absl::StrCat("X-Sightline-Delivery: ", event.sequence));
    headers.Add(absl::StrCat("X-Sightline-Signature: sha256=", Signature(secret, body)));

    const std::unique_ptr<CURL, decltype(&curl_easy_cleanup)> call(curl_easy_init(),
                                                                   &curl_easy_cleanup);
    if (call == nullptr || multi_ == nullptr) return absl::ResourceExhaustedError("out of memory");
    char reason[CURL_ERROR_SIZE] = "";
    size_t answer_bytes = 0;
    const long timeout_ms = static_cast<long>(absl::ToInt64Milliseconds(options_.timeout));
    const auto set = [&](CURLoption option, auto value) {
      curl_easy_setopt(call.get(), option, value);
    };
    set(CURLOPT_URL, options_.url.c_str());
    set(CURLOPT_PROTOCOLS_STR, "http,https");
    set(CURLOPT_FOLLOWLOCATION, 0L);
    set(CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(body.size()));
    set(CURLOPT_POSTFIELDS, body.c_str());
    set(CURLOPT_HTTPHEADER, headers.list);
    set(CURLOPT_USERAGENT, "sightline");
    set(CURLOPT_WRITEFUNCTION, &CountAnswer);
    set(CURLOPT_WRITEDATA, static_cast<void*>(&answer_bytes));
    set(CURLOPT_ERRORBUFFER, reason);
    set(CURLOPT_NOSIGNAL, 1L);
    set(CURLOPT_TIMEOUT_MS, timeout_ms);
    set(CURLOPT_CONNECTTIMEOUT_MS, timeout_ms);
    set(CURLOPT_SSLVERSION, static_cast<long>(CURL_SSLVERSION_TLSv1_2));
    // An interrupted call does not wait for the end of a name lookup.
    set(CURLOPT_QUICK_EXIT, 1L);
    if (!options_.ca_file.empty()) set(CURLOPT_CAINFO, options_.ca_file.c_str());
    // Requests to this machine stay on it, whatever proxy the environment names.
    if (url_.is_loopback) set(CURLOPT_PROXY, "");

    const CURLcode code = Perform(call.get());
    // A write error means that the answer is too long; the receiver has answered.
    const bool answered = code == CURLE_OK || code == CURLE_WRITE_ERROR;
    if (!answered && interrupted_) return absl::CancelledError("interrupted");
    if (!answered) {
      return absl::UnavailableError(
          absl::StrCat("cannot post: ", reason[0] != '\0' ? reason : curl_easy_strerror(code)));
    }
    long http_code = 0;
    curl_easy_getinfo(call.get(), CURLINFO_RESPONSE_CODE, &http_code);
    if (http_code >= 200 && http_code < 300) return absl::OkStatus();
    if (http_code == 410) return absl::FailedPreconditionError("answered 410 Gone");
    return absl::UnavailableError(absl::StrCat("answered ", http_code));
  }

 private:
  CURLcode Perform(CURL* call) {
    if (curl_multi_add_handle(multi_.get(), call) != CURLM_OK) return CURLE_FAILED_INIT;
    CURLcode result = CURLE_FAILED_INIT;
    int running = 1;
    while (!interrupted_ && running > 0) {
      if (curl_multi_perform(multi_.get(), &running) != CURLM_OK) break;
      if (running > 0 &&
          curl_multi_poll(multi_.get(), nullptr, 0, /*timeout_ms=*/1000, nullptr) != CURLM_OK) {
        break;
      }
    }
    int left = 0;
    while (const CURLMsg* message = curl_multi_info_read(multi_.get(), &left)) {
      if (message->msg == CURLMSG_DONE) result = message->data.result;
    }
    curl_multi_remove_handle(multi_.get(), call);
    return result;
  }

  const WebhookOptions options_;
  const ReceiverUrl url_;
  std::atomic<bool> interrupted_ = false;
  // Keeps the connection from one event to the next.
  const std::unique_ptr<CURLM, decltype(&curl_multi_cleanup)> multi_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<EventReceiver>> MakeWebhookReceiver(const WebhookOptions& options) {
  static std::once_flag initialised;
  std::call_once(initialised, [] { curl_global_init(CURL_GLOBAL_DEFAULT); });
  SIGHTLINE_ASSIGN_OR_RETURN(ReceiverUrl url, ParseReceiverUrl(kWebhookUrlOption, options.url));
  if (url.scheme != "http" && url.scheme != "https") {
    return absl::InvalidArgumentError(
        absl::StrCat(kWebhookUrlOption, ": scheme ", url.scheme, " must be https or http"));
  }
  if (url.scheme == "http" && !url.is_loopback && !options.allow_plaintext) {
    return absl::InvalidArgumentError(absl::StrCat(
        kWebhookUrlOption, ": http to ", url.host,
        " would send job events over the network in plain text; use https, or allow it with "
        "--allow-plaintext"));
  }
  if (url.port == 0) url.port = url.scheme == "https" ? 443 : 80;
  SIGHTLINE_RETURN_IF_ERROR(ReadWebhookSecret(options.secret_file).status());
  if (!options.ca_file.empty() && access(options.ca_file.c_str(), R_OK) != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("--webhook-ca ", options.ca_file, ": cannot be read"));
  }
  if (options.timeout < absl::Milliseconds(100) || options.timeout > absl::Seconds(30)) {
    return absl::InvalidArgumentError("timeout of webhooks must be in [100 ms, 30 s]");
  }
  return std::make_unique<WebhookReceiver>(options, std::move(url));
}

}  // namespace sightline
