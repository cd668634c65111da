// SPDX-License-Identifier: Apache-2.0
// A job of a render worker whose result is one message.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "planner_client/rpc_client/worker_call.h"
#include "proto/status/rpc_status.h"

namespace sightline {

// Adds the digests of `count` uploadable files, starting at `first`.
inline void AddAssetDigests(const WorkerCall& call, const std::vector<AssetFile>& files,
                            size_t first, size_t count,
                            google::protobuf::RepeatedPtrField<v1::RenderAsset>* assets) {
  for (size_t i = first; i < first + count; ++i) {
    v1::RenderAsset* asset = assets->Add();
    asset->set_file(files[i].file);
    asset->set_asset_digest(call.digests()[i]);
  }
}

// Creates a job, waits for its end and fetches its answer. `create` sets `created`. With
// `on_waiting_for_rest`, a job that an interrupt has cancelled is awaited until it finishes its
// current step, since it may leave a partial result; the function is called when that wait begins.
template <typename Created>
absl::Status RunAnswerJob(WorkerCall* call, const Created& created,
                          const std::function<grpc::Status(grpc::ClientContext*)>& create,
                          const std::function<grpc::Status(grpc::ClientContext*)>& get,
                          const std::function<void()>& on_waiting_for_rest = nullptr) {
  absl::Status status = call->Create(create);
  if (status.ok()) status = call->WaitForJob(created.job().job_id());
  if (!created.job().job_id().empty() && call->Interrupted() && on_waiting_for_rest) {
    on_waiting_for_rest();
    grpc::ClientContext context;
    status = call->Watch(created.job().job_id(), &context);
  }
  if (status.ok()) {
    grpc::ClientContext context;
    // The job's error if it failed.
    status = FromGrpcStatus(get(&context));
  }
  if (absl::IsUnimplemented(status)) {
    return absl::UnimplementedError(
        absl::StrCat("the render worker cannot do this (is it older?): ", status.message()));
  }
  return status.ok() ? status : call->Explained(status, "interrupted; nothing was written");
}

}  // namespace sightline
