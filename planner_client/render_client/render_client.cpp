#include "planner_client/render_client/render_client.h"

#include <grpcpp/grpcpp.h>
#include <openssl/evp.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <thread>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "proto/status/rpc_status.h"
#include "sightline/v1/job_service.grpc.pb.h"
#include "sightline/v1/render_service.grpc.pb.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxMessageBytes = 64 << 20;
constexpr size_t kUploadChunkBytes = 512 << 10;
constexpr absl::Duration kShortTimeout = absl::Seconds(20);
// Names the asset that must be uploaded; see RenderService.
constexpr char kReasonAssetUnknown[] = "ASSET_UNKNOWN";

class Sha256 {
 public:
  Sha256() : context_(EVP_MD_CTX_new(), EVP_MD_CTX_free) {
    EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr);
  }
  void Add(const std::string& bytes) {
    EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size());
  }
  std::string Hex() {
    std::array<unsigned char, 32> digest;
    EVP_DigestFinal_ex(context_.get(), digest.data(), nullptr);
    return absl::BytesToHexString(
        absl::string_view(reinterpret_cast<const char*>(digest.data()), digest.size()));
  }

 private:
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

std::string DigestOf(const std::string& bytes) {
  Sha256 hash;
  hash.Add(bytes);
  return hash.Hex();
}

void SetTimeout(grpc::ClientContext* context, absl::Duration timeout) {
  context->set_deadline(std::chrono::system_clock::now() +
                        std::chrono::milliseconds(absl::ToInt64Milliseconds(timeout)));
}

std::string NewRequestId() {
  std::random_device device;
  std::string id;
  for (int i = 0; i < 4; ++i) absl::StrAppend(&id, absl::Hex(device(), absl::kZeroPad8));
  return id;
}

// A file under another name until it is complete.
class PartialFile {
 public:
  explicit PartialFile(fs::path path)
      : path_(std::move(path)), temporary_(absl::StrCat(path_.string(), ".part-", getpid())) {}
  ~PartialFile() {
    stream_.close();
    if (!committed_) std::remove(temporary_.c_str());
  }
  PartialFile(const PartialFile&) = delete;
  PartialFile& operator=(const PartialFile&) = delete;

  absl::Status Open() {
    std::error_code error;
    fs::create_directories(path_.parent_path(), error);
    stream_.open(temporary_, std::ios::binary | std::ios::trunc);
    return Check();
  }
  absl::Status Write(const std::string& bytes) {
    stream_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return Check();
  }
  absl::Status Commit() {
    stream_.close();
    if (absl::Status status = Check(); !status.ok()) return status;
    committed_ = std::rename(temporary_.c_str(), path_.c_str()) == 0;
    return committed_ ? absl::OkStatus() : Error();
  }

 private:
  absl::Status Check() const { return stream_ ? absl::OkStatus() : Error(); }
  absl::Status Error() const {
    return absl::InternalError(
        absl::StrCat(path_.string(), ": cannot be written: ", std::strerror(errno)));
  }

  const fs::path path_;
  const std::string temporary_;
  std::ofstream stream_;
  bool committed_ = false;
};

// File names come from the worker: none may leave the folder.
bool StaysInFolder(const std::string& file) {
  const fs::path path(file);
  return !file.empty() && !path.is_absolute() &&
         std::none_of(path.begin(), path.end(), [](const fs::path& p) { return p == ".."; });
}

class RenderCall {
 public:
  RenderCall(const RenderClientOptions& options, v1::RenderSpec spec,
             const std::vector<RenderAssetFile>& assets)
      : options_(options), spec_(std::move(spec)), assets_(assets) {
    for (const RenderAssetFile& asset : assets_) {
      v1::RenderAsset* message = spec_.mutable_part()->add_assets();
      message->set_file(asset.file);
      message->set_asset_digest(DigestOf(asset.bytes));
    }
    grpc::ChannelArguments arguments;
    arguments.SetMaxReceiveMessageSize(kMaxMessageBytes);
    arguments.SetMaxSendMessageSize(kMaxMessageBytes);
    arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 50);
    arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 2000);
    arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 1000);
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    arguments.SetInt(GRPC_ARG_ENABLE_RETRIES, 0);
    std::shared_ptr<grpc::ChannelCredentials> credentials = grpc::InsecureChannelCredentials();
    if (!options_.tls_root_certificates.empty()) {
      grpc::SslCredentialsOptions ssl;
      ssl.pem_root_certs = options_.tls_root_certificates;
      ssl.pem_private_key = options_.tls_key;
      ssl.pem_cert_chain = options_.tls_certificate;
      credentials = grpc::SslCredentials(ssl);
    }
    const auto channel = grpc::CreateCustomChannel(Address(), credentials, arguments);
    render_ = v1::RenderService::NewStub(channel);
    jobs_ = v1::JobService::NewStub(channel);
  }

  absl::StatusOr<std::vector<std::string>> Run(const std::string& folder) {
    absl::StatusOr<v1::Job> job = Create();
    if (!job.ok()) return Explained(job.status());
    // Of an earlier run: it would vouch for images that are about to change.
    std::remove((fs::path(folder) / "recordings.json").c_str());
    absl::StatusOr<std::vector<std::string>> files = Receive(*job, folder);
    if (files.ok()) return files;
    if (!absl::IsUnavailable(files.status())) Cancel(job->job_id());
    return Explained(files.status());
  }

 private:
  std::string Address() const {
    return options_.embedded != nullptr ? options_.embedded->address() : options_.address;
  }
  bool Interrupted() const { return options_.interrupted != nullptr && *options_.interrupted; }

  // Why the worker does not answer any more.
  absl::Status Explained(const absl::Status& status) const {
    if (Interrupted()) return absl::CancelledError("interrupted; finished images are kept");
    if (!absl::IsUnavailable(status)) return status;
    if (options_.embedded != nullptr) {
      // The connection breaks a moment before the process can be waited for.
      for (int i = 0; i < 20 && options_.embedded->CheckAlive().ok(); ++i) {
        absl::SleepFor(absl::Milliseconds(10));
      }
      if (absl::Status ended = options_.embedded->CheckAlive(); !ended.ok()) return ended;
    }
    return absl::UnavailableError(
        absl::StrCat("render worker ", Address(), ": ", status.message()));
  }

  absl::StatusOr<v1::Job> Create() {
    v1::CreateRenderRequest request;
    request.set_request_id(NewRequestId());
    *request.mutable_spec() = spec_;
    const absl::Time start = absl::Now();
    // Every asset may be missing once, plus one round for one dropped in between.
    int uploads_left = static_cast<int>(assets_.size()) + 1;
    for (int attempt = 0;; ++attempt) {
      if (Interrupted()) return absl::CancelledError("interrupted");
      v1::CreateRenderResponse response;
      grpc::ClientContext context;
      SetTimeout(&context, kShortTimeout);
      absl::Status status = FromGrpcStatus(render_->CreateRender(&context, request, &response));
      if (status.ok()) return response.job();
      if (ErrorReason(status) == kReasonAssetUnknown && uploads_left-- > 0) {
        const auto metadata = ErrorMetadata(status);
        const auto digest = metadata.find("asset_digest");
        if (digest == metadata.end()) return status;
        status = Upload(digest->second);
        if (status.ok()) continue;
      }
      const bool alive = options_.embedded == nullptr || options_.embedded->CheckAlive().ok();
      if (!absl::IsUnavailable(status) || !alive || absl::Now() - start > options_.retry_for) {
        return status;
      }
      absl::SleepFor(
          std::max(absl::Milliseconds(50) * (1 << std::min(attempt, 4)),
                   std::min(RetryDelay(status).value_or(absl::ZeroDuration()), absl::Seconds(5))));
    }
  }

  absl::Status Upload(const std::string& digest) {
    for (size_t i = 0; i < assets_.size(); ++i) {
      if (spec_.part().assets(static_cast<int>(i)).asset_digest() != digest) continue;
      const RenderAssetFile& asset = assets_[i];
      if (options_.on_progress) options_.on_progress(0, absl::StrCat("uploading ", asset.file));
      v1::UploadAssetResponse response;
      grpc::ClientContext context;
      SetTimeout(&context,
                 absl::Seconds(60) + absl::Seconds(static_cast<double>(asset.bytes.size()) / 1e6));
      auto writer = render_->UploadAsset(&context, &response);
      v1::UploadAssetRequest message;
      message.mutable_header()->set_size_bytes(static_cast<int64_t>(asset.bytes.size()));
      message.mutable_header()->set_asset_digest(digest);
      message.mutable_header()->set_file_name(asset.file);
      bool open = writer->Write(message);
      for (size_t begin = 0; open && begin < asset.bytes.size(); begin += kUploadChunkBytes) {
        message.set_chunk(asset.bytes.substr(begin, kUploadChunkBytes));
        open = writer->Write(message);
      }
      writer->WritesDone();
      return FromGrpcStatus(writer->Finish());
    }
    return absl::InternalError(absl::StrCat("the worker asks for an unknown asset ", digest));
  }

  void Cancel(const std::string& job_id) {
    grpc::ClientContext context;
    SetTimeout(&context, absl::Seconds(2));
    v1::CancelJobRequest request;
    request.set_job_id(job_id);
    v1::CancelJobResponse ignored;
    jobs_->CancelJob(&context, request, &ignored);
  }

  // Streams files while another thread follows the job's progress and a third the interrupt.
  absl::StatusOr<std::vector<std::string>> Receive(const v1::Job& job, const std::string& folder) {
    grpc::ClientContext files_context, watch_context;
    SetTimeout(&files_context, options_.render_timeout);
    SetTimeout(&watch_context, options_.render_timeout);
    std::jthread watcher([&] {
      v1::WatchJobRequest request;
      request.set_job_id(job.job_id());
      auto reader = jobs_->WatchJob(&watch_context, request);
      v1::WatchJobResponse response;
      while (reader->Read(&response)) {
        if (options_.on_progress) {
          options_.on_progress(response.job().progress(), response.job().message());
        }
      }
      reader->Finish();
    });
    std::jthread interrupter([&](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        if (Interrupted()) {
          Cancel(job.job_id());
          files_context.TryCancel();
          return;
        }
        absl::SleepFor(absl::Milliseconds(20));
      }
    });
    absl::StatusOr<std::vector<std::string>> files = ReadFiles(job, folder, &files_context);
    interrupter.request_stop();
    if (!files.ok()) watch_context.TryCancel();
    watcher.join();
    interrupter.join();
    return files;
  }

  absl::StatusOr<std::vector<std::string>> ReadFiles(const v1::Job& job, const std::string& folder,
                                                     grpc::ClientContext* context) {
    v1::StreamRenderFilesRequest request;
    request.set_job_id(job.job_id());
    auto reader = render_->StreamRenderFiles(context, request);
    std::vector<std::string> files;
    absl::Status status = ReadStream(*reader, folder, &files);
    if (!status.ok()) context->TryCancel();
    const absl::Status finish = FromGrpcStatus(reader->Finish());
    if (!status.ok()) return status;
    if (!finish.ok()) return finish;
    if (files.empty() || files.back() != "recordings.json") {
      return absl::InternalError("the worker ended the job without recordings.json");
    }
    return files;
  }

  absl::Status ReadStream(grpc::ClientReader<v1::StreamRenderFilesResponse>& reader,
                          const std::string& folder, std::vector<std::string>* files) {
    v1::StreamRenderFilesResponse response;
    while (reader.Read(&response)) {
      if (response.content_case() == v1::StreamRenderFilesResponse::kWarning) {
        if (options_.on_warning) options_.on_warning(response.warning());
        continue;
      }
      if (!response.has_header() || response.header().size_bytes() < 0 ||
          !StaysInFolder(response.header().file())) {
        return absl::InternalError("the worker sent something that is no file");
      }
      const v1::StreamRenderFilesResponse::Header header = response.header();
      PartialFile file(fs::path(folder) / header.file());
      if (absl::Status status = file.Open(); !status.ok()) return status;
      Sha256 hash;
      int64_t left = header.size_bytes();
      while (left > 0) {
        // The end of the stream says why.
        if (!reader.Read(&response)) return absl::OkStatus();
        left -= static_cast<int64_t>(response.chunk().size());
        if (response.chunk().empty() || left < 0) {
          return absl::InternalError(
              absl::StrCat("the worker sent ", header.file(), " with another size than it said"));
        }
        hash.Add(response.chunk());
        if (absl::Status status = file.Write(response.chunk()); !status.ok()) return status;
      }
      if (hash.Hex() != header.sha256()) {
        return absl::DataLossError(absl::StrCat(header.file(), " was damaged on its way"));
      }
      if (absl::Status status = file.Commit(); !status.ok()) return status;
      files->push_back(header.file());
    }
    return absl::OkStatus();
  }

  const RenderClientOptions& options_;
  v1::RenderSpec spec_;
  const std::vector<RenderAssetFile>& assets_;
  std::unique_ptr<v1::RenderService::Stub> render_;
  std::unique_ptr<v1::JobService::Stub> jobs_;
};

}  // namespace

absl::StatusOr<std::vector<std::string>> RenderToFolder(const RenderClientOptions& options,
                                                        v1::RenderSpec spec,
                                                        const std::vector<RenderAssetFile>& assets,
                                                        const std::string& folder) {
  return RenderCall(options, std::move(spec), assets).Run(folder);
}

}  // namespace sightline
