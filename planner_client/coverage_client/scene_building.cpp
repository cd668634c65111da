// SPDX-License-Identifier: Apache-2.0
// Builds a scene on a server: uploads the part, watches the job, fetches the targets.
#include <grpcpp/grpcpp.h>

#include <atomic>
#include <cstdint>
#include <string>
#include <thread>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "core/inspection/vector_proto.h"
#include "core/status/status_macros.h"
#include "planner_client/coverage_client/part_upload.h"
#include "planner_client/coverage_client/scene_connection.h"
#include "proto/status/rpc_status.h"

namespace sightline {
absl::Status SceneConnection::CreateScene(CoverageConnection& connection) {
  // Every part may be missing once, plus one round for a scene dropped in between.
  const int max_rounds = static_cast<int>(meshes_.size()) + 2;
  for (int round = 0; round < max_rounds; ++round) {
    v1::CreateSceneRequest request;
    request.set_request_id(NewRequestId());
    *request.mutable_spec() = spec_;
    v1::CreateSceneResponse response;
    grpc::ClientContext context;
    absl::Status status =
        FromGrpcStatus(connection.coverage->CreateScene(&context, request, &response));
    if (ErrorReason(status) == kReasonPartUnknown) {
      const auto metadata = ErrorMetadata(status);
      const auto digest = metadata.find("part_digest");
      const auto mesh = digest == metadata.end() ? meshes_.end() : meshes_.find(digest->second);
      if (mesh == meshes_.end()) return status;
      status = UploadPart(connection, mesh->first, mesh->second);
      if (!status.ok()) return status;
      continue;
    }
    if (!status.ok()) return status;
    SIGHTLINE_ASSIGN_OR_RETURN(v1::Job job, WaitForJob(connection, response.job()));
    switch (job.state()) {
      case v1::Job::STATE_SUCCEEDED:
        if (created_ && job.result_key() != info_.scene_digest) {
          return absl::InternalError(
              "the server made another scene than before: is it another version?");
        }
        if (!created_) info_.scene_digest = job.result_key();
        return absl::OkStatus();
      case v1::Job::STATE_FAILED:
        // A part that was dropped for lack of memory while the job waited.
        if (job.error_code() == static_cast<int>(absl::StatusCode::kNotFound)) continue;
        return absl::Status(static_cast<absl::StatusCode>(job.error_code()),
                            absl::StrCat("building the scene: ", job.error_message()));
      default:
        return absl::CancelledError("building the scene was cancelled");
    }
  }
  return absl::ResourceExhaustedError(
      "the server forgets parts as fast as they are uploaded: its part store is too small");
}

absl::Status SceneConnection::UploadPart(CoverageConnection& connection, const std::string& name,
                                         const NamedMesh& part) {
  Report(0, absl::StrCat("uploading ", part.name));
  const size_t plus = name.find('+');
  const std::string digest = name.substr(0, plus);
  const std::string bytes = EncodePly(*part.mesh, plus != std::string::npos);
  v1::UploadPartResponse response;
  grpc::ClientContext context;
  auto writer = connection.coverage->UploadPart(&context, &response);
  v1::UploadPartRequest message;
  message.mutable_header()->set_format("ply");
  message.mutable_header()->set_unit("m");
  message.mutable_header()->set_size_bytes(static_cast<int64_t>(bytes.size()));
  message.mutable_header()->set_file_name(part.name);
  WriteUpload(*writer, std::move(message), bytes);
  SIGHTLINE_RETURN_IF_ERROR(FromGrpcStatus(writer->Finish()));
  if (response.part_digest() != digest) {
    return absl::InternalError(
        absl::StrCat("the server read ", part.name, " differently: is it another version?"));
  }
  return absl::OkStatus();
}

absl::StatusOr<v1::Job> SceneConnection::WaitForJob(CoverageConnection& connection, v1::Job job) {
  const auto finished = [](const v1::Job& j) { return j.state() >= v1::Job::STATE_SUCCEEDED; };
  const auto report = [this](const v1::Job& j) { Report(j.progress(), j.message()); };
  report(job);
  if (finished(job)) return job;
  grpc::ClientContext context;
  std::atomic<bool> done = false;
  std::thread interrupter;
  if (options_.interrupted != nullptr) {
    interrupter = std::thread([&] {
      while (!done) {
        if (*options_.interrupted) {
          context.TryCancel();
          return;
        }
        absl::SleepFor(absl::Milliseconds(20));
      }
    });
  }
  v1::WatchJobRequest request;
  request.set_job_id(job.job_id());
  auto reader = connection.jobs->WatchJob(&context, request);
  v1::WatchJobResponse response;
  while (reader->Read(&response)) {
    job = response.job();
    report(job);
  }
  absl::Status status = FromGrpcStatus(reader->Finish());
  done = true;
  if (interrupter.joinable()) interrupter.join();
  if (status.ok() && finished(job)) return job;
  if (options_.interrupted != nullptr && *options_.interrupted) {
    status = absl::CancelledError("interrupted while the scene was being built");
  } else if (status.ok()) {
    return absl::InternalError("the server stopped reporting on a job before its end");
  }
  if (!absl::IsUnavailable(status)) {
    // The result is not wanted any more.
    grpc::ClientContext cancel_context;
    SetTimeout(&cancel_context, absl::Seconds(2));
    v1::CancelJobRequest cancel;
    cancel.set_job_id(job.job_id());
    v1::CancelJobResponse ignored;
    connection.jobs->CancelJob(&cancel_context, cancel, &ignored);
  }
  return status;
}

absl::Status SceneConnection::FetchScene(CoverageConnection& connection) {
  v1::GetSceneRequest request;
  request.set_scene_digest(info_.scene_digest);
  v1::GetSceneResponse response;
  grpc::ClientContext context;
  SIGHTLINE_RETURN_IF_ERROR(
      FromGrpcStatus(connection.coverage->GetScene(&context, request, &response)));
  info_.spec = response.spec();
  info_.server_build = response.server_build();
  info_.target_count = response.target_count();
  info_.measurable_count = response.measurable_count();
  info_.measurable_in_free_space_count = response.measurable_in_free_space_count();
  info_.part_centre_m = VectorFromProto(response.part_centre_m());
  info_.part_size_m = VectorFromProto(response.part_size_m());
  info_.field_bytes = response.field_bytes();
  info_.targets_time_s = response.targets_time_s();
  info_.field_time_s = response.field_time_s();
  info_.measurability_time_s = response.measurability_time_s();
  return absl::OkStatus();
}

absl::Status SceneConnection::FetchTargets(CoverageConnection& connection) {
  targets_ = {};
  measurable_orientations_.clear();
  measurable_ = TargetBits(static_cast<size_t>(info_.target_count));
  grpc::ClientContext context;
  v1::StreamTargetsRequest request;
  request.set_scene_digest(info_.scene_digest);
  auto reader = connection.coverage->StreamTargets(&context, request);
  v1::StreamTargetsResponse response;
  while (reader->Read(&response)) {
    const int count = response.regions_size();
    if (response.positions_m_size() != 3 * count || response.normals_size() != 3 * count ||
        response.measurable_size() != count ||
        (response.measurable_orientations_size() != 0 &&
         response.measurable_orientations_size() != count) ||
        static_cast<int64_t>(targets_.size()) + count > info_.target_count) {
      context.TryCancel();
      return absl::InternalError("server answered targets of unequal length");
    }
    for (int i = 0; i < count; ++i) {
      if (response.measurable(i)) measurable_.Set(targets_.size());
      targets_.positions_m.push_back(VectorAt(response.positions_m(), i));
      targets_.normals.push_back(VectorAt(response.normals(), i));
      targets_.regions.push_back(response.regions(i));
    }
    measurable_orientations_.insert(measurable_orientations_.end(),
                                    response.measurable_orientations().begin(),
                                    response.measurable_orientations().end());
  }
  absl::Status status = FromGrpcStatus(reader->Finish());
  if (status.ok() && static_cast<int64_t>(targets_.size()) != info_.target_count) {
    return absl::InternalError("server answered too few targets");
  }
  return status;
}

}  // namespace sightline
