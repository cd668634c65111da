#include "render_worker/service/render_service.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "proto/status/rpc_status.h"
#include "render_worker/service/asset_folder.h"
#include "render_worker/service/reservation.h"
#include "rpc_server/job_service.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxChunkBytes = 1 << 20;
constexpr size_t kFileChunkBytes = 512 << 10;
// Assets that are received at the same time, in units of the largest allowed one.
constexpr int64_t kConcurrentUploads = 2;
constexpr char kJobKind[] = "render";
constexpr absl::Duration kProgressInterval = absl::Milliseconds(50);

// What one job holds on to.
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
  return p_.calls->Run("UploadAsset", context, [&] { return Receive(context, reader, response); });
}

absl::Status RenderServiceImpl::Receive(grpc::ServerContext* context,
                                        grpc::ServerReader<v1::UploadAssetRequest>* reader,
                                        v1::UploadAssetResponse* response) {
  v1::UploadAssetRequest message;
  if (!reader->Read(&message) || !message.has_header()) {
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
  const Reservation reservation(&upload_bytes_, header.size_bytes());
  if (reservation.total() > kConcurrentUploads * p_.max_asset_bytes) {
    return WithRetryDelay(
        WithErrorInfo(absl::UnavailableError("overloaded: too many uploads"), "OVERLOADED"),
        absl::Seconds(1));
  }
  const auto size = static_cast<size_t>(header.size_bytes());
  std::string bytes;
  while (reader->Read(&message)) {
    if (message.content_case() != v1::UploadAssetRequest::kChunk) {
      return InvalidFields({{"chunk", "every message after the header must have one"}});
    }
    if (message.chunk().size() > kMaxChunkBytes) {
      return InvalidFields(
          {{"chunk", absl::StrCat(message.chunk().size(), " bytes: at most ", kMaxChunkBytes)}});
    }
    if (bytes.size() + message.chunk().size() > size) {
      return InvalidFields({{"header.size_bytes", absl::StrCat(size, ": more bytes followed")}});
    }
    bytes += message.chunk();
  }
  if (absl::Status stop = p_.calls->CheckStop(context); !stop.ok()) return stop;
  if (bytes.size() != size) {
    return InvalidFields(
        {{"header.size_bytes", absl::StrCat(size, ": only ", bytes.size(), " bytes followed")}});
  }
  if (const std::string digest = Sha256Hex(bytes);
      !header.asset_digest().empty() && digest != header.asset_digest()) {
    return InvalidFields(
        {{"header.asset_digest", absl::StrCat("is not that of the bytes, ", digest)}});
  }
  absl::StatusOr<std::string> digest = p_.assets->Put(bytes);
  if (!digest.ok()) return digest.status();
  response->set_asset_digest(*digest);
  spdlog::info("event=asset_uploaded asset={} bytes={} name={:?}", *digest, size, name);
  return absl::OkStatus();
}

grpc::Status RenderServiceImpl::CreateRender(grpc::ServerContext* context,
                                             const v1::CreateRenderRequest* request,
                                             v1::CreateRenderResponse* response) {
  return p_.calls->Run("CreateRender", context, [&] { return Create(*request, response); });
}

absl::Status RenderServiceImpl::Create(const v1::CreateRenderRequest& request,
                                       v1::CreateRenderResponse* response) {
  auto task = RenderTask::Parse(request.spec(), p_.max_image_bytes);
  if (!task.ok()) return task.status();
  const int64_t number = next_folder_++;
  auto work = std::make_shared<RenderWork>(absl::StrCat(p_.spool_folder, "/render-input-", number));
  work->task = *std::move(task);
  absl::Status added = work->assets.Add(request.spec().part().assets(), "part.assets", p_.assets);
  if (!added.ok()) return added;
  for (const std::string& file : work->task->AssetFiles()) {
    if (work->assets.Has(file)) continue;
    return InvalidFields({{"part.assets", absl::StrCat("has no entry for ", file)}});
  }
  std::lock_guard lock(create_mutex_);
  const std::string folder = absl::StrCat(p_.spool_folder, "/job-", number);
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    return absl::ResourceExhaustedError(
        absl::StrCat(folder, ": cannot be made: ", error.message()));
  }
  work->output = std::make_shared<RenderOutput>(folder);
  const auto output = work->output;
  absl::StatusOr<JobRecord> job = p_.jobs->Create(
      kJobKind, request.request_id(), MessageDigest(request.spec()),
      [this, work](JobContext& job_context) -> absl::StatusOr<std::string> {
        RenderTaskHooks hooks;
        hooks.on_file = [&](RenderedFile file) { work->output->AddFile(std::move(file)); };
        hooks.on_warning = [&](const std::string& warning) {
          spdlog::warn("event=render_warning message={:?}", warning);
          work->output->AddWarning(warning);
        };
        // Every report wakes all who watch.
        absl::Time reported = absl::InfinitePast();
        hooks.on_progress = [&](double fraction, const std::string& message) {
          const absl::Time now = absl::Now();
          if (now - reported < kProgressInterval) return;
          reported = now;
          job_context.ReportProgress(fraction, message);
        };
        hooks.cancelled = &job_context.cancelled();
        hooks.threads = p_.threads;
        hooks.max_image_bytes = p_.max_image_bytes;
        absl::Status status = work->task->Run(
            work->output->folder(),
            [&](const std::string& file) { return work->assets.Resolve(file); }, hooks);
        p_.outputs->Trim();
        if (!status.ok()) return work->assets.WithoutFolder(status);
        return std::string();
      });
  if (!job.ok()) return job.status();
  // A job that was there already keeps its output.
  p_.outputs->Add(job->job_id, output);
  *response->mutable_job() = JobToProto(*job);
  return absl::OkStatus();
}

grpc::Status RenderServiceImpl::StreamRenderFiles(
    grpc::ServerContext* context, const v1::StreamRenderFilesRequest* request,
    grpc::ServerWriter<v1::StreamRenderFilesResponse>* writer) {
  return p_.calls->Run("StreamRenderFiles", context,
                       [&] { return Stream(context, *request, writer); });
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
  if (!job.ok() || output == nullptr) {
    return WithErrorInfo(absl::NotFoundError(absl::StrCat(
                             "no render job \"", absl::Utf8SafeCEscape(request.job_id()), "\"")),
                         "JOB_UNKNOWN");
  }
  const absl::Status gone = absl::CancelledError("the client went away");
  auto sent = static_cast<size_t>(request.skip_files());
  size_t warnings = 0;
  while (true) {
    // The job's state first: what it made before it ended is sent.
    job = p_.jobs->Get(request.job_id());
    if (!job.ok()) return job.status();
    v1::StreamRenderFilesResponse response;
    for (const std::string& warning : output->WarningsFrom(warnings)) {
      response.set_warning(warning);
      if (!writer->Write(response)) return gone;
      ++warnings;
    }
    for (const RenderedFile& file : output->FilesFrom(sent)) {
      response.mutable_header()->set_file(file.file);
      response.mutable_header()->set_size_bytes(file.size_bytes);
      response.mutable_header()->set_sha256(file.sha256);
      response.mutable_header()->set_image(file.image);
      if (!writer->Write(response)) return gone;
      std::ifstream bytes(fs::path(output->folder()) / file.file, std::ios::binary);
      std::string chunk(kFileChunkBytes, '\0');
      int64_t left = file.size_bytes;
      while (left > 0) {
        if (absl::Status stop = p_.calls->CheckStop(context); !stop.ok()) return stop;
        chunk.resize(static_cast<size_t>(std::min<int64_t>(left, kFileChunkBytes)));
        if (!bytes.read(chunk.data(), static_cast<std::streamsize>(chunk.size()))) {
          return absl::InternalError(absl::StrCat(file.file, ": cannot be read back"));
        }
        response.set_chunk(chunk);
        if (!writer->Write(response)) return gone;
        left -= static_cast<int64_t>(chunk.size());
      }
      ++sent;
    }
    if (job->finished()) return job->error;
    if (absl::Status stop = p_.calls->CheckStop(context); !stop.ok()) return stop;
    if (p_.calls->draining()) {
      return WithErrorInfo(absl::UnavailableError("the server is shutting down"), "DRAINING");
    }
    p_.jobs->WaitForChange(request.job_id(), job->revision, absl::Milliseconds(50))
        .status()
        .IgnoreError();
  }
}

}  // namespace sightline
