// SPDX-License-Identifier: Apache-2.0
#include "render_worker/service/render_service.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/digest/sha256.h"
#include "core/parallel/exception_status.h"
#include "core/process/program_build.h"
#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"
#include "render_worker/service/answer_jobs.h"
#include "render_worker/service/asset_folder.h"
#include "render_worker/service/without_folders.h"
#include "rpc_server/file_stream.h"
#include "rpc_server/job_service.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr char kRenderJobKind[] = "render";

// Resources of one job.
struct RenderWork {
  explicit RenderWork(std::string input_folder) : assets(std::move(input_folder)) {}
  std::unique_ptr<RenderTask> task;
  AssetFolder assets;
  std::shared_ptr<RenderOutput> output;
};

}  // namespace

grpc::Status RenderServiceImpl::UploadAsset(grpc::ServerContext* context,
                                            grpc::ServerReader<v1::UploadAssetRequest>* reader,
                                            v1::UploadAssetResponse* response) {
  return p_.calls->Run(
      "UploadAsset", context, [&] { return Receive(context, reader, response); },
      CallKind::kStream);
}

absl::Status RenderServiceImpl::Receive(grpc::ServerContext* context,
                                        grpc::ServerReader<v1::UploadAssetRequest>* reader,
                                        v1::UploadAssetResponse* response) {
  v1::UploadAssetRequest message;
  SIGHTLINE_ASSIGN_OR_RETURN(const bool begun,
                             p_.calls->Read(context, [&] { return reader->Read(&message); }));
  if (!begun || !message.has_header()) {
    return InvalidFields({{"header", "must be the first message"}});
  }
  const v1::UploadAssetRequest::Header header = message.header();
  const std::string name = absl::Utf8SafeCEscape(header.file_name().substr(0, 200));
  if (header.size_bytes() <= 0) {
    return InvalidFields(
        {{"header.size_bytes", absl::StrCat(header.size_bytes(), ": must be > 0")}});
  }
  if (header.size_bytes() > p_.max_asset_bytes) {
    return WithErrorInfo(
        absl::ResourceExhaustedError(absl::StrCat("asset ", name, " of ", header.size_bytes(),
                                                  " bytes: the server accepts at most ",
                                                  p_.max_asset_bytes, " (--max-asset-bytes)")),
        "ASSET_TOO_LARGE", {{"max_asset_bytes", absl::StrCat(p_.max_asset_bytes)}});
  }
  SIGHTLINE_ASSIGN_OR_RETURN(
      const ReceivedFile file,
      ReceiveChunks(p_.calls, context, reader, header.size_bytes(), upload_memory_));
  if (const std::string digest = Sha256Hex(file.bytes);
      !header.asset_digest().empty() && digest != header.asset_digest()) {
    return InvalidFields(
        {{"header.asset_digest", absl::StrCat("is not that of the bytes, ", digest)}});
  }
  SIGHTLINE_ASSIGN_OR_RETURN(std::string digest, p_.assets->Put(file.bytes));
  response->set_asset_digest(digest);
  spdlog::info("event=asset_uploaded asset={} bytes={} name={:?}", digest, header.size_bytes(),
               name);
  return absl::OkStatus();
}

grpc::Status RenderServiceImpl::CreateRender(grpc::ServerContext* context,
                                             const v1::CreateRenderRequest* request,
                                             v1::CreateRenderResponse* response) {
  return p_.calls->Run("CreateRender", context,
                       [&] { return Create(PeerOf(*context), *request, response); });
}

absl::Status RenderServiceImpl::Create(const std::string& peer,
                                       const v1::CreateRenderRequest& request,
                                       v1::CreateRenderResponse* response) {
  auto admission = AdmitJob(
      p_.jobs, kRenderJobKind, request.request_id(), [&] { return MessageDigest(request.spec()); },
      peer, [&] { return MemoryOf(request); });
  if (!admission.ok()) return admission.status();
  if (admission->known) {
    // The call that created the job holds the lock until its output is kept.
    const std::lock_guard lock(create_mutex_);
    *response->mutable_job() = *std::move(admission->known);
    return absl::OkStatus();
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto task, RenderTask::Parse(request.spec(), p_.max_image_bytes));
  const int64_t number = next_folder_++;
  auto work = std::make_shared<RenderWork>(absl::StrCat(p_.spool_folder, "/render-input-", number));
  work->task = std::move(task);
  SIGHTLINE_RETURN_IF_ERROR(
      work->assets.Add(request.spec().part().assets(), "part.assets", p_.assets));
  for (const std::string& file : work->task->AssetFiles()) {
    if (work->assets.Has(file)) continue;
    return InvalidFields({{"part.assets", absl::StrCat("has no entry for ", file)}});
  }
  const std::string digest = MessageDigest(request.spec());
  std::lock_guard lock(create_mutex_);
  const std::string folder = absl::StrCat(p_.spool_folder, "/job-", number);
  work->output = std::make_shared<RenderOutput>(folder);
  const auto output = work->output;
  absl::StatusOr<JobRecord> job = p_.jobs->Create(
      kRenderJobKind, request.request_id(), digest,
      [this, work](JobContext& job_context) -> absl::StatusOr<std::string> {
        const std::vector<std::string> folders = {work->output->folder(), p_.spool_folder};
        absl::Status made = work->output->MakeFolder();
        if (!made.ok()) return WithoutFolders(made, folders);
        RenderTaskHooks hooks;
        hooks.on_file = [&](RenderedFile file) { work->output->AddFile(std::move(file)); };
        hooks.on_warning = [&](const std::string& warning) {
          spdlog::warn("event=render_warning message={:?}", warning);
          work->output->AddWarning(WithoutFolders(work->assets.WithoutFolder(warning), folders));
        };
        // Every report wakes all who watch.
        std::optional<std::chrono::steady_clock::time_point> reported;
        hooks.on_progress = [&](double fraction, const std::string& message) {
          const auto now = std::chrono::steady_clock::now();
          if (reported && now - *reported < kProgressInterval) return;
          reported = now;
          job_context.ReportProgress(fraction, message);
        };
        hooks.cancelled = &job_context.cancelled();
        hooks.threads = p_.threads;
        hooks.max_image_bytes = p_.max_image_bytes;
        absl::Status status;
        try {
          status = work->task->Run(
              work->output->folder(),
              [&](const std::string& file) { return work->assets.Resolve(file); }, hooks);
        } catch (...) {
          status = StatusOfException();
        }
        if (job_context.cancelled()) {
          work->output->Discard();
        } else if (!status.ok() && work->output->FilesFrom(0).empty()) {
          work->output->RemoveFolder();
        }
        work->output->Finish();
        p_.outputs->Trim();
        if (!status.ok()) return WithoutFolders(work->assets.WithoutFolder(status), folders);
        return std::string();
      },
      std::move(admission->room));
  if (!job.ok()) return job.status();
  // A job that was there already keeps its output.
  p_.outputs->Add(job->job_id, output);
  *response->mutable_job() = JobToProto(*job);
  return absl::OkStatus();
}

grpc::Status RenderServiceImpl::StreamRenderFiles(
    grpc::ServerContext* context, const v1::StreamRenderFilesRequest* request,
    grpc::ServerWriter<v1::StreamRenderFilesResponse>* writer) {
  return p_.calls->Run(
      "StreamRenderFiles", context, [&] { return Stream(context, *request, writer); },
      CallKind::kStream);
}

grpc::Status RenderServiceImpl::GetRenderWorker(grpc::ServerContext* context,
                                                const v1::GetRenderWorkerRequest*,
                                                v1::GetRenderWorkerResponse* response) {
  return p_.calls->Run("GetRenderWorker", context, [&] {
    response->set_server_build(ProgramBuild());
    return absl::OkStatus();
  });
}

absl::Status RenderServiceImpl::Stream(grpc::ServerContext* context,
                                       const v1::StreamRenderFilesRequest& request,
                                       grpc::ServerWriter<v1::StreamRenderFilesResponse>* writer) {
  if (request.skip_files() < 0) {
    return InvalidFields(
        {{"skip_files", absl::StrCat(request.skip_files(), ": must not be negative")}});
  }
  absl::StatusOr<JobRecord> job = p_.jobs->Get(request.job_id());
  const std::shared_ptr<RenderOutput> output = p_.outputs->Get(request.job_id());
  if (output == nullptr && job.ok() && job->kind == kRenderJobKind && !job->error.ok()) {
    return job->error;
  }
  if (!job.ok() || output == nullptr) {
    return WithErrorInfo(absl::NotFoundError(absl::StrCat(
                             "no render job \"", absl::Utf8SafeCEscape(request.job_id()), "\"")),
                         "JOB_UNKNOWN");
  }
  v1::StreamRenderFilesResponse response;
  const auto send = [&] {
    return p_.calls->Write(context, [&] { return writer->Write(response); });
  };
  auto sent = static_cast<size_t>(request.skip_files());
  size_t warnings = 0;
  while (true) {
    // The job's state first: files that it made before it ended are sent.
    job = p_.jobs->Get(request.job_id());
    if (!job.ok()) return job.status();
    for (const std::string& warning : output->WarningsFrom(warnings)) {
      response.set_warning(warning);
      SIGHTLINE_RETURN_IF_ERROR(send());
      ++warnings;
    }
    for (const RenderedFile& file : output->FilesFrom(sent)) {
      response.mutable_header()->set_file(file.file);
      response.mutable_header()->set_size_bytes(file.size_bytes);
      response.mutable_header()->set_sha256(file.sha256);
      response.mutable_header()->set_image(file.image);
      SIGHTLINE_RETURN_IF_ERROR(send());
      SIGHTLINE_RETURN_IF_ERROR(SendChunks(p_.calls, context, writer,
                                           fs::path(output->folder()) / file.file, file.file, 0,
                                           file.size_bytes, &response));
      ++sent;
    }
    if (job->finished()) return job->error;
    SIGHTLINE_RETURN_IF_ERROR(p_.calls->CheckStop(context));
    if (p_.calls->draining()) {
      return WithErrorInfo(absl::UnavailableError("the server is shutting down"), "DRAINING");
    }
    p_.jobs->WaitForChange(request.job_id(), job->revision, absl::Milliseconds(50))
        .status()
        .IgnoreError();
  }
}

}  // namespace sightline
