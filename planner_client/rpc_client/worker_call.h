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
  // UNAVAILABLE before the job was created is tried again for at most this long. Later it is an
  // error: a worker that ended has lost the job.
  absl::Duration retry_for = absl::Seconds(10);
  std::function<void(double progress, const std::string& message)> on_progress;
  // Cancels the job when it becomes true. May be null.
  const std::atomic<bool>* interrupted = nullptr;
};

// A file that goes with a request.
struct AssetFile {
  std::string file;  // as it stands in the request
  std::string bytes;
};

class WorkerCall {
 public:
  // Both must outlive it.
  WorkerCall(const WorkerClientOptions& options, const std::vector<AssetFile>& assets);

  const std::shared_ptr<grpc::Channel>& channel() const { return channel_; }
  // SHA-256 of the assets, in their order.
  const std::vector<std::string>& digests() const { return digests_; }
  bool Interrupted() const { return options_.interrupted != nullptr && *options_.interrupted; }

  // Makes the call that creates the job; uploads assets the worker asks for, and retries
  // UNAVAILABLE. `create` sends the same request every time.
  absl::Status Create(const std::function<grpc::Status(grpc::ClientContext*)>& create);

  // Reports progress until the job is finished; the stream's error if it ends before. A step that
  // takes long is reported every second, so that the time it takes is seen to pass. These reports
  // come from a thread of their own, one report at a time.
  absl::Status Watch(const std::string& job_id, grpc::ClientContext* context);
  // While it runs: an interrupt cancels the job and `context`. Ends when asked to stop.
  std::jthread CancelWhenInterrupted(const std::string& job_id, grpc::ClientContext* context);
  // Watches the job until it is finished, however that is; cancels it if the stream breaks for
  // another reason than the end of the worker.
  absl::Status WaitForJob(const std::string& job_id);
  void Cancel(const std::string& job_id);

  // Why the worker does not answer any more; other errors as they are. `interrupted`: the message
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
