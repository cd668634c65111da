// SPDX-License-Identifier: Apache-2.0
#include "rpc_server/call_tracker.h"

#include <grpc/grpc.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/parallel/exception_status.h"
#include "core/trace/trace_context.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

absl::Status Draining() {
  return WithRetryDelay(
      WithErrorInfo(absl::UnavailableError("the server is shutting down"), "DRAINING"),
      absl::Milliseconds(500));
}

// Traceparent of the caller, or a new one if the caller sent none, so that the log lines of one
// call can be found together.
std::string TraceparentOf(const grpc::ServerContext& context) {
  const auto& metadata = context.client_metadata();
  const auto found = metadata.find(kTraceparentKey);
  const std::string given =
      found == metadata.end() ? "" : ValidTraceparent({found->second.data(), found->second.size()});
  return given.empty() ? NewTraceparent() : given;
}

absl::Status TooManyOfPeer(const std::string& peer, int limit, const char* what) {
  return WithErrorInfo(
      absl::ResourceExhaustedError(absl::StrCat(peer, " has ", limit, " ", what,
                                                " open already, which is the most allowed")),
      "PEER_QUOTA_EXCEEDED", {{"limit", absl::StrCat(limit)}});
}

absl::Status TooMany(int limit, const char* what) {
  return WithRetryDelay(
      WithErrorInfo(absl::UnavailableError(absl::StrCat("overloaded: ", limit, " ", what,
                                                        " are open, which is the most possible")),
                    "OVERLOADED"),
      absl::Seconds(1));
}

}  // namespace

std::string PeerOf(const grpc::ServerContext& context) {
  const auto auth = context.auth_context();
  if (auth != nullptr && auth->IsPeerAuthenticated()) {
    const std::vector<grpc::string_ref> names = auth->GetPeerIdentity();
    if (!names.empty()) return absl::StrCat("name:", std::string(names[0].data(), names[0].size()));
  }
  std::string peer = context.peer();  // "ipv4:192.0.2.1:50000", "unix:..."
  if (peer.rfind("ipv", 0) == 0) peer.resize(std::min(peer.size(), peer.rfind(':')));
  return peer;
}

class CallTracker::TimeLimit {
 public:
  TimeLimit(CallTracker* calls, grpc::ServerContext* context, absl::Duration time,
            std::string message)
      : calls_(calls) {
    const std::lock_guard lock(calls_->watch_mutex_);
    if (!calls_->watcher_.joinable()) {
      calls_->watcher_ = std::thread([calls] { calls->EndOverdueCalls(); });
    }
    number_ = calls_->next_watched_++;
    calls_->watched_[number_] = {Clock::now() + absl::ToChronoNanoseconds(time), context,
                                 std::move(message), &expired_};
    calls_->watch_changed_.notify_one();
  }
  ~TimeLimit() { Stop(); }
  TimeLimit(const TimeLimit&) = delete;
  TimeLimit& operator=(const TimeLimit&) = delete;

  // Removes the limit. Returns whether it has ended the call before.
  bool Stop() {
    const std::lock_guard lock(calls_->watch_mutex_);
    calls_->watched_.erase(number_);
    return expired_;
  }

 private:
  CallTracker* const calls_;
  int64_t number_ = 0;
  bool expired_ = false;
};

CallTracker::~CallTracker() {
  {
    const std::lock_guard lock(watch_mutex_);
    watch_stopping_ = true;
    watch_changed_.notify_one();
  }
  if (watcher_.joinable()) watcher_.join();
}

void CallTracker::EndOverdueCalls() {
  std::unique_lock lock(watch_mutex_);
  while (!watch_stopping_) {
    const auto now = Clock::now();
    auto next = now + std::chrono::hours(1);
    for (auto it = watched_.begin(); it != watched_.end();) {
      Watched& watched = it->second;
      if (watched.end > now) {
        next = std::min(next, watched.end);
        ++it;
        continue;
      }
      *watched.expired = true;
      // Like ServerContext::TryCancel, but with a status for the client.
      grpc_call_cancel_with_status(watched.context->c_call(), GRPC_STATUS_DEADLINE_EXCEEDED,
                                   watched.message.c_str(), nullptr);
      it = watched_.erase(it);
    }
    watch_changed_.wait_until(lock, next);
  }
}

void CallTracker::OnSaturation(std::function<void(bool)> notify) {
  const std::lock_guard lock(notify_mutex_);
  notify_ = std::move(notify);
}

absl::Status CallTracker::Admit(const std::string& peer, CallKind kind) {
  const std::lock_guard lock(mutex_);
  const OpenCalls& of_peer = open_of_peer_[peer];
  const bool stream = kind == CallKind::kStream;
  absl::Status refused;
  // If the server as a whole has too many streams, a later retry can succeed.
  if (stream && open_.streams >= limits_.max_streams) {
    refused = TooMany(limits_.max_streams, "streams");
  } else if (stream && of_peer.streams >= limits_.max_streams_per_peer) {
    refused = TooManyOfPeer(peer, limits_.max_streams_per_peer, "streams");
  } else if (of_peer.calls >= limits_.max_calls_per_peer) {
    refused = TooManyOfPeer(peer, limits_.max_calls_per_peer, "calls");
  }
  if (!refused.ok()) {
    if (of_peer.calls == 0) open_of_peer_.erase(peer);
    return refused;
  }
  for (OpenCalls* open : {&open_, &open_of_peer_[peer]}) {
    ++open->calls;
    open->streams += stream ? 1 : 0;
  }
  return absl::OkStatus();
}

void CallTracker::Release(const std::string& peer, CallKind kind) {
  const std::lock_guard lock(mutex_);
  const auto of_peer = open_of_peer_.find(peer);
  for (OpenCalls* open : {&open_, &of_peer->second}) {
    --open->calls;
    open->streams -= kind == CallKind::kStream ? 1 : 0;
  }
  if (of_peer->second.calls == 0) open_of_peer_.erase(of_peer);
}

void CallTracker::PublishSaturation() {
  // State and notification change under one lock, so that the last notification is true.
  const std::lock_guard notify_lock(notify_mutex_);
  bool saturated = false;
  int streams = 0;
  {
    const std::lock_guard lock(mutex_);
    streams = open_.streams;
    // Hysteresis: on at 7/8, off below 6/8 of the calls, so that not every call changes the state.
    const int64_t busy_eighths = saturated_ ? 6 : 7;
    saturated = int64_t{8} * open_.calls >= busy_eighths * limits_.max_calls ||
                open_.streams >= limits_.max_streams;
    saturated_ = saturated;
  }
  metrics_->SetStreams(streams, saturated);
  if (saturated == notified_ || draining_) return;
  notified_ = saturated;
  spdlog::warn("event={}", saturated ? "saturated" : "not_saturated");
  if (notify_) notify_(saturated);
}

grpc::Status CallTracker::Run(const std::string& method, grpc::ServerContext* context,
                              const std::function<absl::Status()>& call, CallKind kind) {
  const auto start = Clock::now();
  const ScopedTrace trace(TraceparentOf(*context));
  AddInFlight(1);
  const std::string peer = PeerOf(*context);
  // Counted before it is tested, so that a drain either sees this call or refuses it.
  absl::Status status = draining_ ? Draining() : Admit(peer, kind);
  if (status.ok()) {
    PublishSaturation();
    try {
      status = call();
    } catch (...) {
      status = StatusOfException();
    }
    Release(peer, kind);
    PublishSaturation();
  } else {
    metrics_->CountRefused();
  }
  const absl::Duration latency = absl::FromChrono(Clock::now() - start);
  const std::string code = absl::StatusCodeToString(status.code());
  metrics_->CountRequest(method, code, latency);
  // NOT_FOUND is normal, because clients then upload; CANCELLED comes from the client.
  const bool expected = status.ok() || absl::IsNotFound(status) || absl::IsCancelled(status);
  const auto level = expected                   ? spdlog::level::debug
                     : absl::IsInternal(status) ? spdlog::level::err
                                                : spdlog::level::warn;
  if (spdlog::should_log(level)) {
    spdlog::log(level, "event=call method={} code={} duration_ms={:.3f} peer={} message={:?}",
                method, code, absl::ToDoubleMilliseconds(latency), context->peer(),
                std::string(status.message()));
  }
  AddInFlight(-1);
  return ToGrpcStatus(status);
}

absl::StatusOr<bool> CallTracker::Read(grpc::ServerContext* context,
                                       const std::function<bool()>& read, absl::Duration patience) {
  const std::string message =
      absl::StrCat("no message came within ", absl::FormatDuration(patience));
  TimeLimit limit(this, context, patience, message);
  AddInFlight(-1);
  const bool more = read();
  AddInFlight(1);
  // The limit has ended the call, so a message that came at the last moment is of no use.
  if (limit.Stop()) return absl::DeadlineExceededError(message);
  return more;
}

absl::Status CallTracker::Write(grpc::ServerContext* context, const std::function<bool()>& write) {
  const std::string message = absl::StrCat("the client took no message within ",
                                           absl::FormatDuration(limits_.idle_timeout));
  TimeLimit limit(this, context, limits_.idle_timeout, message);
  const bool written = write();
  if (limit.Stop()) return absl::DeadlineExceededError(message);
  return written ? absl::OkStatus() : absl::CancelledError("the client went away");
}

absl::Status CallTracker::CheckStop(grpc::ServerContext* context) const {
  if (cancel_all_) return Draining();
  // gRPC ends calls at their deadline by a clock that never jumps; the wall clock only tells the
  // two reasons apart.
  if (!context->IsCancelled()) return absl::OkStatus();
  if (std::chrono::system_clock::now() >= context->deadline()) {
    return absl::DeadlineExceededError("the client's deadline passed");
  }
  return absl::CancelledError("the client cancelled the call");
}

bool CallTracker::WaitUntilIdle(absl::Duration timeout) {
  std::unique_lock lock(mutex_);
  return idle_.wait_for(lock, absl::ToChronoNanoseconds(timeout),
                        [this] { return in_flight_ == 0; });
}

void CallTracker::AddInFlight(int change) {
  std::lock_guard lock(mutex_);
  in_flight_ += change;
  metrics_->SetInFlight(in_flight_);
  if (in_flight_ == 0) idle_.notify_all();
}

}  // namespace sightline
