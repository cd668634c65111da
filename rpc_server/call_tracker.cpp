#include "rpc_server/call_tracker.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <exception>
#include <new>

#include "core/trace/trace_context.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

absl::Status Draining() {
  return WithRetryDelay(
      WithErrorInfo(absl::UnavailableError("the server is shutting down"), "DRAINING"),
      absl::Milliseconds(500));
}

// Of the caller; one of its own where he has none, so that the lines of one call can be found
// together.
std::string TraceparentOf(const grpc::ServerContext& context) {
  const auto& metadata = context.client_metadata();
  const auto found = metadata.find(kTraceparentKey);
  const std::string given =
      found == metadata.end() ? "" : ValidTraceparent({found->second.data(), found->second.size()});
  return given.empty() ? NewTraceparent() : given;
}

}  // namespace

grpc::Status CallTracker::Run(const std::string& method, grpc::ServerContext* context,
                              const std::function<absl::Status()>& call) {
  const absl::Time start = absl::Now();
  const ScopedTrace trace(TraceparentOf(*context));
  AddInFlight(1);
  absl::Status status;
  // Counted before it is tested, so that a drain either sees this call or refuses it.
  if (draining_) {
    status = Draining();
  } else {
    try {
      status = call();
    } catch (const std::bad_alloc&) {
      status = absl::ResourceExhaustedError("out of memory");
    } catch (const std::exception& e) {
      status = absl::InternalError(e.what());
    }
  }
  const absl::Duration latency = absl::Now() - start;
  const std::string code = absl::StatusCodeToString(status.code());
  metrics_->CountRequest(method, code, latency);
  // NOT_FOUND is how clients learn what to upload, CANCELLED is their own doing.
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

bool CallTracker::WhileIdle(const std::function<bool()>& wait) {
  AddInFlight(-1);
  const bool more = wait();
  AddInFlight(1);
  return more;
}

absl::Status CallTracker::CheckStop(grpc::ServerContext* context) const {
  if (cancel_all_) return Draining();
  if (std::chrono::system_clock::now() >= context->deadline()) {
    return absl::DeadlineExceededError("the client's deadline passed");
  }
  if (context->IsCancelled()) return absl::CancelledError("the client cancelled the call");
  return absl::OkStatus();
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
