#include "render_worker/service/render_service.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "proto/status/rpc_status.h"
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

std::string Normalised(const std::string& file) { return fs::path(file).lexically_normal(); }

// The same bytes for the same request, whatever order its maps are in.
std::string Fingerprint(const v1::RenderSpec& spec) {
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);
    spec.SerializeToCodedStream(&coded);
  }
  return Sha256Hex(bytes);
}

absl::Status UnknownAsset(const std::string& file, const std::string& digest) {
  return WithErrorInfo(
      absl::NotFoundError(absl::StrCat("asset ", file, " (", digest, ") must be uploaded first")),
      "ASSET_UNKNOWN", {{"file", file}, {"asset_digest", digest}});
}

// Adds to a counter for as long as it lives.
class Reservation {
 public:
  Reservation(std::atomic<int64_t>* counter, int64_t amount) : counter_(counter), amount_(amount) {
    total_ = counter_->fetch_add(amount_) + amount_;
  }
  ~Reservation() { *counter_ -= amount_; }
  Reservation(const Reservation&) = delete;
  Reservation& operator=(const Reservation&) = delete;
  int64_t total() const { return total_; }

 private:
  std::atomic<int64_t>* counter_;
  int64_t amount_;
  int64_t total_;
};

// What one job holds on to.
struct RenderWork {
  std::unique_ptr<RenderTask> task;
  std::map<std::string, std::shared_ptr<const Asset>> assets;  // by file
  std::shared_ptr<RenderOutput> output;
  std::string input_folder;  // links to the assets by the names of the request

  ~RenderWork() {
    std::error_code ignored;
    if (!input_folder.empty()) fs::remove_all(input_folder, ignored);
  }

  absl::StatusOr<std::string> Resolve(const std::string& file) const {
    const fs::path name = Normalised(file);
    const auto asset = assets.find(name.string());
    if (asset == assets.end()) {
      return absl::NotFoundError(absl::StrCat(file, ": is not among the assets of the request"));
    }
    const fs::path link = fs::path(input_folder) / name;
    std::error_code error;
    fs::create_directories(link.parent_path(), error);
    fs::create_symlink(asset->second->path(), link, error);
    if (error && !fs::is_symlink(link)) {
      return absl::InternalError(absl::StrCat(file, ": cannot be opened: ", error.message()));
    }
    return link.string();
  }

  // The client knows its files by the names it gave them.
  absl::Status WithoutFolder(const absl::Status& status) const {
    const std::string message =
        absl::StrReplaceAll(status.message(), {{absl::StrCat(input_folder, "/"), ""}});
    absl::Status renamed(status.code(), message);
    status.ForEachPayload([&renamed](absl::string_view type_url, const absl::Cord& payload) {
      renamed.SetPayload(type_url, payload);
    });
    return renamed;
  }
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
  auto work = std::make_shared<RenderWork>();
  work->task = *std::move(task);
  for (int i = 0; i < request.spec().part().assets_size(); ++i) {
    const v1::RenderAsset& asset = request.spec().part().assets(i);
    auto stored = p_.assets->Get(asset.asset_digest());
    if (stored == nullptr) return UnknownAsset(asset.file(), asset.asset_digest());
    const std::string name = Normalised(asset.file());
    if (name.empty() || name[0] == '/' || absl::StartsWith(name, "..")) {
      return InvalidFields({{absl::StrCat("part.assets[", i, "].file"),
                             absl::StrCat("is \"", absl::Utf8SafeCEscape(asset.file()),
                                          "\", must be a relative name without ..")}});
    }
    work->assets[name] = std::move(stored);
  }
  for (const std::string& file : work->task->AssetFiles()) {
    if (work->assets.count(Normalised(file)) > 0) continue;
    return InvalidFields({{"part.assets", absl::StrCat("has no entry for ", file)}});
  }
  std::lock_guard lock(create_mutex_);
  const int64_t number = next_folder_++;
  const std::string folder = absl::StrCat(p_.spool_folder, "/job-", number);
  work->input_folder = absl::StrCat(p_.spool_folder, "/input-", number);
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    return absl::ResourceExhaustedError(
        absl::StrCat(folder, ": cannot be made: ", error.message()));
  }
  work->output = std::make_shared<RenderOutput>(folder);
  const auto output = work->output;
  absl::StatusOr<JobRecord> job = p_.jobs->Create(
      kJobKind, request.request_id(), Fingerprint(request.spec()),
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
            work->output->folder(), [&](const std::string& file) { return work->Resolve(file); },
            hooks);
        p_.outputs->Trim();
        if (!status.ok()) return work->WithoutFolder(status);
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
