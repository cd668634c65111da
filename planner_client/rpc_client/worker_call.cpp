// SPDX-License-Identifier: Apache-2.0
#include "planner_client/rpc_client/worker_call.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>

#include "absl/strings/str_cat.h"
#include "core/digest/sha256.h"
#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

// Names the asset that must be uploaded; see RenderService.
constexpr char kReasonAssetUnknown[] = "ASSET_UNKNOWN";

}  // namespace

WorkerCall::WorkerCall(const WorkerClientOptions& options, const std::vector<AssetFile>& assets)
    : options_(options), assets_(assets), channel_(OpenChannel(options)) {
  for (const AssetFile& asset : assets_) digests_.push_back(Sha256Hex(asset.bytes));
  assets_stub_ = v1::RenderService::NewStub(channel_);
  jobs_ = v1::JobService::NewStub(channel_);
}

absl::Status WorkerCall::Create(const std::function<grpc::Status(grpc::ClientContext*)>& create) {
  const auto start = std::chrono::steady_clock::now();
  // Every asset may be missing once, plus one round for one dropped in between.
  int uploads_left = static_cast<int>(assets_.size()) + 1;
  for (int attempt = 0;;) {
    if (Interrupted()) return absl::CancelledError("interrupted");
    grpc::ClientContext context;
    absl::Status status = FromGrpcStatus(create(&context));
    if (status.ok()) return status;
    if (ErrorReason(status) == kReasonAssetUnknown && uploads_left-- > 0) {
      const auto metadata = ErrorMetadata(status);
      const auto digest = metadata.find("asset_digest");
      if (digest == metadata.end()) return status;
      status = Upload(digest->second);
      if (status.ok()) continue;
    }
    if (!absl::IsUnavailable(status)) return status;
    if (options_.embedded != nullptr && !options_.embedded->CheckAlive().ok()) {
      // Only assets are lost so far, and the worker requests them again.
      SIGHTLINE_RETURN_IF_ERROR(options_.embedded->Restart());
      uploads_left = static_cast<int>(assets_.size()) + 1;
      continue;
    }
    if (absl::FromChrono(std::chrono::steady_clock::now() - start) > options_.retry_for) {
      return status;
    }
    absl::SleepFor(
        std::max(RetryPause(attempt++),
                 std::min(RetryDelay(status).value_or(absl::ZeroDuration()), absl::Seconds(5))));
  }
}

absl::Status WorkerCall::Upload(const std::string& digest) {
  const auto found = std::find(digests_.begin(), digests_.end(), digest);
  if (found == digests_.end()) {
    return absl::InternalError(absl::StrCat("the worker asks for an unknown asset ", digest));
  }
  const AssetFile& asset = assets_[static_cast<size_t>(found - digests_.begin())];
  if (options_.on_progress) options_.on_progress(0, absl::StrCat("uploading ", asset.file));
  v1::UploadAssetResponse response;
  grpc::ClientContext context;
  auto writer = assets_stub_->UploadAsset(&context, &response);
  v1::UploadAssetRequest message;
  message.mutable_header()->set_size_bytes(static_cast<int64_t>(asset.bytes.size()));
  message.mutable_header()->set_asset_digest(digest);
  message.mutable_header()->set_file_name(asset.file);
  WriteUpload(*writer, std::move(message), asset.bytes);
  return FromGrpcStatus(writer->Finish());
}

absl::Status WorkerCall::Watch(const std::string& job_id, grpc::ClientContext* context) {
  v1::WatchJobRequest request;
  request.set_job_id(job_id);
  auto reader = jobs_->WatchJob(context, request);
  std::mutex mutex;
  std::condition_variable_any ended;
  v1::Job last;
  const auto report = [&] {
    if (options_.on_progress) options_.on_progress(last.progress(), last.message());
  };
  const std::jthread repeater([&](const std::stop_token& stop) {
    std::unique_lock lock(mutex);
    while (!ended.wait_for(lock, stop, std::chrono::seconds(1),
                           [&] { return stop.stop_requested(); })) {
      if (!last.job_id().empty() && !stop.stop_requested()) report();
    }
  });
  v1::WatchJobResponse response;
  while (reader->Read(&response)) {
    const std::lock_guard lock(mutex);
    last = response.job();
    report();
  }
  return FromGrpcStatus(reader->Finish());
}

absl::Status WorkerCall::WaitForJob(const std::string& job_id) {
  grpc::ClientContext context;
  std::jthread interrupter = CancelWhenInterrupted(job_id, &context);
  absl::Status status = Watch(job_id, &context);
  interrupter.request_stop();
  interrupter.join();
  if (!status.ok() && !absl::IsUnavailable(status)) Cancel(job_id);
  return status;
}

std::jthread WorkerCall::CancelWhenInterrupted(const std::string& job_id,
                                               grpc::ClientContext* context) {
  return std::jthread([this, job_id, context](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      if (Interrupted()) {
        Cancel(job_id);
        context->TryCancel();
        return;
      }
      absl::SleepFor(absl::Milliseconds(20));
    }
  });
}

void WorkerCall::Cancel(const std::string& job_id) {
  grpc::ClientContext context;
  SetTimeout(&context, absl::Seconds(2));
  v1::CancelJobRequest request;
  request.set_job_id(job_id);
  v1::CancelJobResponse ignored;
  jobs_->CancelJob(&context, request, &ignored);
}

absl::Status WorkerCall::Explained(const absl::Status& status,
                                   const std::string& interrupted) const {
  if (Interrupted()) return absl::CancelledError(interrupted);
  if (!absl::IsUnavailable(status)) return status;
  if (options_.embedded != nullptr) {
    // The connection breaks shortly before the process can be waited for.
    for (int i = 0; i < 20 && options_.embedded->CheckAlive().ok(); ++i) {
      absl::SleepFor(absl::Milliseconds(10));
    }
    SIGHTLINE_RETURN_IF_ERROR(options_.embedded->CheckAlive());
  }
  return absl::UnavailableError(
      absl::StrCat("render worker ", options_.Address(), ": ", status.message()));
}

}  // namespace sightline
