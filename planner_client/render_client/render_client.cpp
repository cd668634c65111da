// SPDX-License-Identifier: Apache-2.0
#include "planner_client/render_client/render_client.h"

#include <grpcpp/grpcpp.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <thread>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/digest/sha256.h"
#include "core/status/status_macros.h"
#include "planner_client/render_client/finished_images.h"
#include "proto/status/rpc_status.h"
#include "sightline/v1/render_service.grpc.pb.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

// In the names of files that are not complete.
constexpr char kPartialMark[] = ".part-";

// Processes of several machines may write into the same folder.
std::string HostName() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

// A file under another name until it is complete.
class PartialFile {
 public:
  explicit PartialFile(fs::path path)
      : path_(std::move(path)),
        temporary_(absl::StrCat(path_.string(), kPartialMark, HostName(), "-", getpid())) {}
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
    SIGHTLINE_RETURN_IF_ERROR(Check());
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

// Removes files of killed processes; no other process uses the folder at that time.
void RemovePartialFiles(const std::string& folder) {
  std::error_code error;
  std::vector<fs::path> partial;
  for (auto entry = fs::recursive_directory_iterator(folder, error);
       !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    if (absl::StrContains(entry->path().filename().string(), kPartialMark)) {
      partial.push_back(entry->path());
    }
  }
  for (const fs::path& path : partial) fs::remove(path, error);
}

// The worker supplies file names: none may leave the folder.
bool StaysInFolder(const std::string& file) {
  const fs::path path(file);
  return !file.empty() && !path.is_absolute() &&
         std::none_of(path.begin(), path.end(), [](const fs::path& p) { return p == ".."; });
}

class RenderCall {
 public:
  RenderCall(const RenderClientOptions& options, v1::RenderSpec spec,
             const std::vector<AssetFile>& assets)
      : options_(options),
        spec_(std::move(spec)),
        call_(options, assets),
        render_(v1::RenderService::NewStub(call_.channel())) {
    for (size_t i = 0; i < assets.size(); ++i) {
      v1::RenderAsset* message = spec_.mutable_part()->add_assets();
      message->set_file(assets[i].file);
      message->set_asset_digest(call_.digests()[i]);
    }
  }

  absl::StatusOr<std::vector<std::string>> Run(const std::string& folder) {
    constexpr char kInterrupted[] = "interrupted; finished images are kept";
    if (!options_.checkpoint_file.empty()) {
      if (!IsPart()) RemovePartialFiles(folder);
      const auto build = WorkerBuild();
      if (!build.ok()) return call_.Explained(build.status(), kInterrupted);
      SIGHTLINE_ASSIGN_OR_RETURN(
          finished_, FinishedImages::Open(options_.checkpoint_file, folder, spec_, *build));
      for (const std::string& remark : finished_->remarks()) {
        if (options_.on_warning) options_.on_warning(remark);
      }
      for (const int image : finished_->images()) {
        spec_.mutable_output()->add_finished_images(image);
      }
    }
    // For this part those of the others are as good as finished.
    const int images = spec_.has_plate() ? spec_.plate().recordings().recordings_size()
                                         : spec_.part().frames_size();
    for (int image = 0; image < images; ++image) {
      if (image % options_.part_count != options_.part) {
        spec_.mutable_output()->add_finished_images(image);
      }
    }
    v1::CreateRenderRequest request;
    request.set_request_id(NewRequestId());
    *request.mutable_spec() = spec_;
    v1::CreateRenderResponse response;
    absl::Status status = call_.Create([&](grpc::ClientContext* context) {
      return render_->CreateRender(context, request, &response);
    });
    if (!status.ok()) return call_.Explained(status, kInterrupted);
    const v1::Job& job = response.job();
    // An earlier run's file would wrongly confirm images that are about to change.
    if (!IsPart()) std::remove((fs::path(folder) / "recordings.json").c_str());
    absl::StatusOr<std::vector<std::string>> files = Receive(job, folder);
    if (files.ok()) return files;
    if (!absl::IsUnavailable(files.status())) call_.Cancel(job.job_id());
    return call_.Explained(files.status(), kInterrupted);
  }

 private:
  // SHA-256 of the worker's program; empty: it is older than this question.
  absl::StatusOr<std::string> WorkerBuild() {
    v1::GetRenderWorkerResponse response;
    const absl::Status status = call_.Create([&](grpc::ClientContext* context) {
      return render_->GetRenderWorker(context, v1::GetRenderWorkerRequest(), &response);
    });
    if (absl::IsUnimplemented(status)) return std::string();
    if (!status.ok()) return status;
    return response.server_build();
  }

  // Streams files while another thread follows the job's progress and a third the interrupt.
  absl::StatusOr<std::vector<std::string>> Receive(const v1::Job& job, const std::string& folder) {
    grpc::ClientContext files_context, watch_context;
    std::jthread watcher([&] { call_.Watch(job.job_id(), &watch_context).IgnoreError(); });
    std::jthread interrupter = call_.CancelWhenInterrupted(job.job_id(), &files_context);
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
    if (finished_) files = finished_->files();
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
      SIGHTLINE_RETURN_IF_ERROR(file.Open());
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
        hash.Update(response.chunk());
        SIGHTLINE_RETURN_IF_ERROR(file.Write(response.chunk()));
      }
      if (hash.Hex() != header.sha256()) {
        return absl::DataLossError(absl::StrCat(header.file(), " was damaged on its way"));
      }
      // The description completes a set, so only the run after all shards writes it.
      const bool commits = !IsPart() || header.image() >= 0;
      SIGHTLINE_RETURN_IF_ERROR(commits ? file.Commit() : absl::OkStatus());
      files->push_back(header.file());
      if (finished_) finished_->AddFile(header.image(), header.file(), header.sha256());
    }
    return absl::OkStatus();
  }

  bool IsPart() const { return options_.part_count > 1; }

  const RenderClientOptions& options_;
  v1::RenderSpec spec_;
  std::optional<FinishedImages> finished_;
  WorkerCall call_;
  std::unique_ptr<v1::RenderService::Stub> render_;
};

}  // namespace

absl::StatusOr<std::vector<std::string>> RenderToFolder(const RenderClientOptions& options,
                                                        v1::RenderSpec spec,
                                                        const std::vector<AssetFile>& assets,
                                                        const std::string& folder) {
  return RenderCall(options, std::move(spec), assets).Run(folder);
}

}  // namespace sightline
