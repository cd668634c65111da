// SPDX-License-Identifier: Apache-2.0
#include "planning_service/grpc_api/planning_service.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "planning_service/access/certificate_names.h"
#include "proto/status/rpc_status.h"
#include "rpc_server/file_stream.h"
#include "rpc_server/upload.h"

namespace sightline {
namespace {

// Time between checks that the client is still connected.
constexpr absl::Duration kWatchPause = absl::Milliseconds(250);
constexpr absl::string_view kBearer = "Bearer ";

std::string Text(const grpc::string_ref& value) { return {value.data(), value.size()}; }

PeerCredentials CredentialsOf(const grpc::ServerContext& context) {
  PeerCredentials peer;
  if (const auto auth = context.auth_context(); auth != nullptr && auth->IsPeerAuthenticated()) {
    for (const grpc::string_ref& pem : auth->FindPropertyValues("x509_pem_cert")) {
      peer.certificate_names = CertificateNamesOfPem({pem.data(), pem.size()});
    }
  }
  const auto& metadata = context.client_metadata();
  if (const auto authorization = metadata.find("authorization"); authorization != metadata.end()) {
    const std::string value = Text(authorization->second);
    if (absl::StartsWithIgnoreCase(value, kBearer))
      peer.bearer_token = value.substr(kBearer.size());
  }
  return peer;
}

std::vector<JobFile> FilesOf(const google::protobuf::RepeatedPtrField<v1::JobFile>& messages) {
  std::vector<JobFile> files;
  files.reserve(static_cast<size_t>(messages.size()));
  for (const v1::JobFile& message : messages)
    files.push_back({message.name(), message.digest(), 0});
  return files;
}

// Puts the job into an answer.
template <typename Response>
absl::Status Answer(const absl::StatusOr<PlanningJob>& job, Response* response) {
  if (!job.ok()) return job.status();
  *response->mutable_job() = PlanningJobToProto(*job);
  return absl::OkStatus();
}

}  // namespace

grpc::Status PlanningServiceImpl::RunAs(const char* method, grpc::ServerContext* context,
                                        const std::function<absl::Status(const Client&)>& call,
                                        CallKind kind) {
  const auto identified = [&]() -> absl::Status {
    const absl::StatusOr<Client> client = access_->Identify(CredentialsOf(*context));
    return client.ok() ? call(*client) : client.status();
  };
  return calls_->Run(method, context, identified, kind);
}

grpc::Status PlanningServiceImpl::UploadFile(grpc::ServerContext* context,
                                             grpc::ServerReader<v1::UploadFileRequest>* reader,
                                             v1::UploadFileResponse* response) {
  return RunAs(
      "UploadFile", context,
      [&](const Client& client) { return Upload(client, context, reader, response); },
      CallKind::kStream);
}

absl::Status PlanningServiceImpl::Upload(const Client& client, grpc::ServerContext* context,
                                         grpc::ServerReader<v1::UploadFileRequest>* reader,
                                         v1::UploadFileResponse* response) {
  v1::UploadFileRequest message;
  SIGHTLINE_ASSIGN_OR_RETURN(const bool begun,
                             calls_->Read(context, [&] { return reader->Read(&message); }));
  if (!begun || !message.has_header()) {
    return InvalidFields({{"header", "must be the first message"}});
  }
  const v1::UploadFileRequest::Header header = message.header();
  if (header.size_bytes() < 0)
    return InvalidFields({{"header.size_bytes", "must not be negative"}});
  if (header.size_bytes() > client.max_upload_bytes) {
    return WithErrorInfo(absl::ResourceExhaustedError(
                             absl::StrCat("header.size_bytes: ", header.size_bytes(),
                                          ", a file may have at most ", client.max_upload_bytes)),
                         "UPLOAD_TOO_LARGE");
  }
  SIGHTLINE_ASSIGN_OR_RETURN(FileUpload upload, jobs_->Upload(client));
  SIGHTLINE_RETURN_IF_ERROR(
      ForEachChunk(calls_, context, reader, header.size_bytes(),
                   [&](const std::string& chunk) { return upload.Write(chunk); }));
  SIGHTLINE_ASSIGN_OR_RETURN(const JobFile file, upload.Finish(header.digest()));
  response->set_digest(file.digest);
  response->set_size_bytes(file.size_bytes);
  return absl::OkStatus();
}

grpc::Status PlanningServiceImpl::CreatePlanningJob(grpc::ServerContext* context,
                                                    const v1::CreatePlanningJobRequest* request,
                                                    v1::CreatePlanningJobResponse* response) {
  return RunAs("CreatePlanningJob", context, [&](const Client& client) {
    return Answer(jobs_->Create(client, request->request_id(), request->task(),
                                FilesOf(request->files()), request->priority()),
                  response);
  });
}

grpc::Status PlanningServiceImpl::GetPlanningJob(grpc::ServerContext* context,
                                                 const v1::GetPlanningJobRequest* request,
                                                 v1::GetPlanningJobResponse* response) {
  return RunAs("GetPlanningJob", context, [&](const Client& client) {
    return Answer(jobs_->Get(client, request->job_id()), response);
  });
}

grpc::Status PlanningServiceImpl::ListPlanningJobs(grpc::ServerContext* context,
                                                   const v1::ListPlanningJobsRequest* request,
                                                   v1::ListPlanningJobsResponse* response) {
  return RunAs("ListPlanningJobs", context, [&](const Client& client) -> absl::Status {
    SIGHTLINE_ASSIGN_OR_RETURN(const PlanningJobs::Page page, jobs_->List(client, *request));
    for (const PlanningJob& job : page.jobs) *response->add_jobs() = PlanningJobToProto(job);
    response->set_next_page_token(page.next_page_token);
    return absl::OkStatus();
  });
}

grpc::Status PlanningServiceImpl::CancelPlanningJob(grpc::ServerContext* context,
                                                    const v1::CancelPlanningJobRequest* request,
                                                    v1::CancelPlanningJobResponse* response) {
  return RunAs("CancelPlanningJob", context, [&](const Client& client) {
    return Answer(jobs_->Cancel(client, request->job_id()), response);
  });
}

grpc::Status PlanningServiceImpl::WatchPlanningJob(
    grpc::ServerContext* context, const v1::WatchPlanningJobRequest* request,
    grpc::ServerWriter<v1::WatchPlanningJobResponse>* writer) {
  return RunAs(
      "WatchPlanningJob", context,
      [&](const Client& client) { return Watch(client, context, request->job_id(), writer); },
      CallKind::kStream);
}

absl::Status PlanningServiceImpl::Watch(const Client& client, grpc::ServerContext* context,
                                        const std::string& job_id,
                                        grpc::ServerWriter<v1::WatchPlanningJobResponse>* writer) {
  int64_t sent_revision = -1;
  absl::StatusOr<PlanningJob> job = jobs_->Get(client, job_id);
  while (job.ok()) {
    if (job->revision > sent_revision) {
      sent_revision = job->revision;
      v1::WatchPlanningJobResponse response;
      *response.mutable_job() = PlanningJobToProto(*job);
      SIGHTLINE_RETURN_IF_ERROR(calls_->Write(context, [&] { return writer->Write(response); }));
    }
    if (job->IsFinished()) return absl::OkStatus();
    SIGHTLINE_RETURN_IF_ERROR(calls_->CheckStop(context));
    if (calls_->draining()) {
      return WithErrorInfo(absl::UnavailableError("the server is shutting down: watch again"),
                           "DRAINING");
    }
    job = jobs_->WaitForChange(client, job_id, sent_revision, kWatchPause);
  }
  return job.status();
}

grpc::Status PlanningServiceImpl::StreamResult(
    grpc::ServerContext* context, const v1::StreamResultRequest* request,
    grpc::ServerWriter<v1::StreamResultResponse>* writer) {
  return RunAs(
      "StreamResult", context,
      [&](const Client& client) { return Stream(client, context, *request, writer); },
      CallKind::kStream);
}

absl::Status PlanningServiceImpl::Stream(const Client& client, grpc::ServerContext* context,
                                         const v1::StreamResultRequest& request,
                                         grpc::ServerWriter<v1::StreamResultResponse>* writer) {
  SIGHTLINE_ASSIGN_OR_RETURN(const OpenResult result,
                             jobs_->Result(client, request.job_id(), request.name()));
  const int64_t size = result.file.size_bytes;
  if (request.offset() < 0 || request.offset() > size) {
    return InvalidFields(
        {{"offset", absl::StrCat("is ", request.offset(), ", must be in [0, ", size, "]")}});
  }
  v1::StreamResultResponse response;
  response.mutable_header()->set_name(result.file.name);
  response.mutable_header()->set_digest(result.file.digest);
  response.mutable_header()->set_size_bytes(size);
  SIGHTLINE_RETURN_IF_ERROR(calls_->Write(context, [&] { return writer->Write(response); }));
  return SendChunks(calls_, context, writer, result.path, result.file.name, request.offset(), size,
                    &response);
}

grpc::Status PlanningServiceImpl::PrepareRecipe(grpc::ServerContext* context,
                                                const v1::PrepareRecipeRequest* request,
                                                v1::PrepareRecipeResponse* response) {
  return RunAs("PrepareRecipe", context, [&](const Client& client) -> absl::Status {
    SIGHTLINE_ASSIGN_OR_RETURN(const std::string digest,
                               jobs_->PrepareRecipe(client, request->recipe_id(), request->task(),
                                                    FilesOf(request->files())));
    response->set_recipe_id(request->recipe_id());
    response->set_digest(digest);
    return absl::OkStatus();
  });
}

grpc::Status PlanningServiceImpl::UnprepareRecipe(grpc::ServerContext* context,
                                                  const v1::UnprepareRecipeRequest* request,
                                                  v1::UnprepareRecipeResponse*) {
  return RunAs("UnprepareRecipe", context, [&](const Client& client) {
    return jobs_->UnprepareRecipe(client, request->recipe_id());
  });
}

grpc::Status PlanningServiceImpl::StartJob(grpc::ServerContext* context,
                                           const v1::StartJobRequest* request,
                                           v1::StartJobResponse* response) {
  return RunAs("StartJob", context, [&](const Client& client) {
    return Answer(
        jobs_->StartJob(client, request->request_id(), request->recipe_id(), request->priority()),
        response);
  });
}

grpc::Status PlanningServiceImpl::GetResultById(grpc::ServerContext* context,
                                                const v1::GetResultByIdRequest* request,
                                                v1::GetResultByIdResponse* response) {
  return RunAs("GetResultById", context, [&](const Client& client) -> absl::Status {
    const absl::StatusOr<PlanningJob> job = jobs_->Get(client, request->job_id());
    if (job.ok() && !job->IsFinished()) {
      return WithErrorInfo(
          absl::FailedPreconditionError(absl::StrCat("job \"", job->job_id, "\" has not finished")),
          "JOB_NOT_FINISHED");
    }
    return Answer(job, response);
  });
}

grpc::Status PlanningServiceImpl::GetVisionState(grpc::ServerContext* context,
                                                 const v1::GetVisionStateRequest*,
                                                 v1::GetVisionStateResponse* response) {
  return RunAs("GetVisionState", context, [&](const Client& client) -> absl::Status {
    SIGHTLINE_ASSIGN_OR_RETURN(*response, jobs_->VisionState(client));
    return absl::OkStatus();
  });
}

}  // namespace sightline
