// SPDX-License-Identifier: Apache-2.0
// One job of a render worker: assets, retries, progress, interrupt. Calls wait as long as the
// worker shows signs of life: channel.h.
#pragma once

#include <grpcpp/grpcpp.h>

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "planner_client/rpc_client/channel.h"
#include "sightline/v1/job_service.grpc.pb.h"
#include "sightline/v1/render_service.grpc.pb.h"

namespace sightline {

struct WorkerClientOptions : ServerAccess {
  // UNAVAILABLE is retried for at most this time, but only before the job was created. Later it is
  // an error: a worker that ended has lost the job.
  absl::Duration retry_for = absl::Seconds(10);
  std::function<void(double progress, const std::string& message)> on_progress;
  // Cancels the job when it becomes true. May be null.
  const std::atomic<bool>* interrupted = nullptr;
};

// A file that goes with a request.
struct AssetFile {
  std::string file;  // as in the request
  std::string bytes;
};

class WorkerCall {
 public:
  // Both must outlive this object.
  WorkerCall(const WorkerClientOptions& options, const std::vector<AssetFile>& assets);

  const std::shared_ptr<grpc::Channel>& channel() const { return channel_; }
  // SHA-256 of the assets, in their order.
  const std::vector<std::string>& digests() const { return digests_; }
  bool Interrupted() const { return options_.interrupted != nullptr && *options_.interrupted; }

  // Makes the call that creates the job; uploads assets the worker asks for, and retries
  // UNAVAILABLE. `create` sends the same request every time.
  absl::Status Create(const std::function<grpc::Status(grpc::ClientContext*)>& create);

  // Reports progress until the job is finished; returns the stream's error if it ends earlier.
  // During a long step, progress is reported every second to show the elapsed time. These reports
  // come from a separate thread, one at a time.
  absl::Status Watch(const std::string& job_id, grpc::ClientContext* context);
  // Thread that cancels the job and `context` after an interrupt, until it is asked to stop.
  std::jthread CancelWhenInterrupted(const std::string& job_id, grpc::ClientContext* context);
  // Watches the job until it is finished in any state. Cancels it if the stream breaks although the
  // worker is alive.
  absl::Status WaitForJob(const std::string& job_id);
  void Cancel(const std::string& job_id);

  // The reason why the worker no longer answers; other errors unchanged. `interrupted`: message
  // after an interrupt.
  absl::Status Explained(const absl::Status& status, const std::string& interrupted) const;

 private:
  absl::Status Upload(const std::string& digest);

  const WorkerClientOptions& options_;
  const std::vector<AssetFile>& assets_;
  std::vector<std::string> digests_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::RenderService::Stub> assets_stub_;
  std::unique_ptr<v1::JobService::Stub> jobs_;
};

}  // namespace sightline
