// SPDX-License-Identifier: Apache-2.0
// Handles what all calls of a server have in common: admission, draining, time limits, metrics,
// logs, status mapping.
#pragma once

#include <grpcpp/server_context.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <mutex>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "rpc_server/server_metrics.h"

namespace sightline {

// A stream waits for its client and holds a thread for as long as the client likes. Streams have a
// limit of their own (CallLimits), so that they never hold all threads.
enum class CallKind { kUnary, kStream };

struct CallLimits {
  // Open calls of both kinds together. The server is saturated from seven eighths of them on.
  int max_calls = std::numeric_limits<int>::max();
  int max_calls_per_peer = std::numeric_limits<int>::max();
  int max_streams = std::numeric_limits<int>::max();
  int max_streams_per_peer = std::numeric_limits<int>::max();
  // How long a stream may wait for its client to send or to take a message.
  absl::Duration idle_timeout = absl::Seconds(60);
};

// Identity of the caller: the name in its certificate if it has one, else its address without the
// port. All clients of a unix socket are one peer.
std::string PeerOf(const grpc::ServerContext& context);

// Thread-safe.
class CallTracker {
 public:
  explicit CallTracker(ServerMetrics* metrics) : metrics_(metrics) {}
  ~CallTracker();
  CallTracker(const CallTracker&) = delete;
  CallTracker& operator=(const CallTracker&) = delete;

  // To be called before the first call.
  void SetLimits(const CallLimits& limits) { limits_ = limits; }
  const CallLimits& limits() const { return limits_; }
  // Calls `notify(saturated)` on every change of saturation, one call at a time. Null: no calls.
  void OnSaturation(std::function<void(bool)> notify);

  // Runs one call, counts and logs it; exceptions become errors. Refusals: UNAVAILABLE (reason
  // DRAINING) while draining, RESOURCE_EXHAUSTED (PEER_QUOTA_EXCEEDED) if its peer has too many
  // calls or streams open, UNAVAILABLE (OVERLOADED) if all peers have too many streams open.
  grpc::Status Run(const std::string& method, grpc::ServerContext* context,
                   const std::function<absl::Status()>& call, CallKind kind = CallKind::kUnary);

  // Waits for the client's next message inside Run, without holding up a drain. Returns the result
  // of `read`; DEADLINE_EXCEEDED, also for the client, if no message came within `patience`.
  absl::StatusOr<bool> Read(grpc::ServerContext* context, const std::function<bool()>& read,
                            absl::Duration patience);
  absl::StatusOr<bool> Read(grpc::ServerContext* context, const std::function<bool()>& read) {
    return Read(context, read, limits_.idle_timeout);
  }
  // Sends a message inside Run. CANCELLED: the client went away; DEADLINE_EXCEEDED: the client took
  // no message within the idle timeout.
  absl::Status Write(grpc::ServerContext* context, const std::function<bool()>& write);

  // Reason to stop this call now: the client went away, its deadline passed, or the server ends.
  // OK: there is none.
  absl::Status CheckStop(grpc::ServerContext* context) const;

  // Refuses new calls from now on.
  void StartDraining() { draining_ = true; }
  bool draining() const { return draining_; }
  // True when no call is running any more; false after the timeout.
  bool WaitUntilIdle(absl::Duration timeout);
  // Makes CheckStop fail for every call.
  void CancelAll() { cancel_all_ = true; }

 private:
  using Clock = std::chrono::steady_clock;
  struct OpenCalls {
    int calls = 0;
    int streams = 0;
  };
  // Ends a call when its time is over, unless the limit is destroyed or stopped before.
  class TimeLimit;
  struct Watched {
    Clock::time_point end;
    grpc::ServerContext* context;
    std::string message;
    bool* expired;
  };

  absl::Status Admit(const std::string& peer, CallKind kind);
  void Release(const std::string& peer, CallKind kind);
  void AddInFlight(int change);
  void PublishSaturation();
  void EndOverdueCalls();

  ServerMetrics* const metrics_;
  CallLimits limits_;
  std::atomic<bool> draining_ = false;
  std::atomic<bool> cancel_all_ = false;
  std::mutex mutex_;
  std::condition_variable idle_;
  int in_flight_ = 0;  // calls that hold up a drain
  OpenCalls open_;
  std::map<std::string, OpenCalls> open_of_peer_;
  bool saturated_ = false;

  std::mutex notify_mutex_;
  std::function<void(bool)> notify_;
  bool notified_ = false;

  std::mutex watch_mutex_;
  std::condition_variable watch_changed_;
  std::map<int64_t, Watched> watched_;
  int64_t next_watched_ = 0;
  bool watch_stopping_ = false;
  std::thread watcher_;  // started with the first limit
};

}  // namespace sightline
