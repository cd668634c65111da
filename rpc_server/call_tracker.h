// What every call of a server has in common: draining, metrics, logs, status mapping.
#pragma once

#include <grpcpp/server_context.h>

#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "rpc_server/server_metrics.h"

namespace sightline {

// Thread-safe.
class CallTracker {
 public:
  explicit CallTracker(ServerMetrics* metrics) : metrics_(metrics) {}

  // Runs one call: refuses it with UNAVAILABLE (reason DRAINING) while draining, turns exceptions
  // into errors, counts and logs it.
  grpc::Status Run(const std::string& method, grpc::ServerContext* context,
                   const std::function<absl::Status()>& call);

  // Waiting for the client's next message inside Run: does not hold up a drain.
  bool WhileIdle(const std::function<bool()>& wait);

  // Why this call should stop now: the client went away, its deadline passed, the server ends.
  // OK: it should not.
  absl::Status CheckStop(grpc::ServerContext* context) const;

  // Refuses new calls from now on.
  void StartDraining() { draining_ = true; }
  bool draining() const { return draining_; }
  // True when no call is running any more; false after the timeout.
  bool WaitUntilIdle(absl::Duration timeout);
  // Makes CheckStop fail for every call.
  void CancelAll() { cancel_all_ = true; }

 private:
  void AddInFlight(int change);

  ServerMetrics* metrics_;
  std::atomic<bool> draining_ = false;
  std::atomic<bool> cancel_all_ = false;
  std::mutex mutex_;
  std::condition_variable idle_;
  int in_flight_ = 0;
};

}  // namespace sightline
